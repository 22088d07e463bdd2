// How many lines of one kind reach the log. Somebody who is refused a million times must not fill the disk.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace varimesh::server {

/// Lets the first lines of each kind in a minute through and counts the others. Thread-safe.
class LineRate {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `most`: lines of a kind in a minute. There should be few kinds.
  explicit LineRate(int most, std::function<Time()> clock = std::chrono::steady_clock::now)
      : most_(most), clock_(std::move(clock)) {}

  /// Returns whether a line of this kind is to be written.
  bool take(const std::string& kind) {
    const Time now = clock_();
    const std::lock_guard lock(mutex_);
    Minute& minute = minutes_.try_emplace(kind, Minute{now}).first->second;
    if (now - minute.begin >= kMinute && minute.left_out == 0) minute = Minute{now};
    if (minute.written < most_) return ++minute.written, true;
    ++minute.left_out;
    return false;
  }

  /// Returns how many lines of which kinds were left out in minutes that are over, and counts them no more. Called
  /// regularly: after a minute with lines that were left out, the next begins with this call.
  std::map<std::string, std::int64_t> left_out() {
    const Time now = clock_();
    const std::lock_guard lock(mutex_);
    std::map<std::string, std::int64_t> counts;
    for (auto& [kind, minute] : minutes_) {
      if (now - minute.begin < kMinute || minute.left_out == 0) continue;
      counts[kind] = minute.left_out;
      minute = Minute{now};
    }
    return counts;
  }

 private:
  static constexpr std::chrono::minutes kMinute{1};

  /// What happened to the lines of a kind since `begin`.
  struct Minute {
    Time begin;
    int written = 0;
    std::int64_t left_out = 0;
  };

  const int most_;
  const std::function<Time()> clock_;
  std::mutex mutex_;
  std::map<std::string, Minute> minutes_;
};

}  // namespace varimesh::server
