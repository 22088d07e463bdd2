// How often a caller may do something.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace varimesh::server {

/// A limit per minute for each caller: who has done nothing for a minute may do `most` at once, and each of them comes
/// back evenly within a minute (a token bucket). Thread-safe.
class Rate {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `most`: how many in a minute. 0: no limit.
  Rate(int most, std::function<Time()> clock) : most_(most), clock_(std::move(clock)) {}

  int most() const { return most_; }
  /// Counts one more for the caller and returns 0, or returns after how many seconds the caller may try again.
  int take(const std::string& caller);
  /// Forgets one that take() has counted.
  void give_back(const std::string& caller);

 private:
  struct Bucket {
    double used = 0;  ///< At `time`; less later.
    Time time;
  };
  double used(const Bucket& bucket, Time now) const;

  const int most_;
  const std::function<Time()> clock_;
  std::mutex mutex_;
  std::map<std::string, Bucket> buckets_;
};

}  // namespace varimesh::server
