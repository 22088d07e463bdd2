// The memory that all running jobs may use together.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>

namespace varimesh::server {

/// Gives memory to jobs in the order in which they ask. A job that waits is not overtaken by smaller jobs. Thread-safe.
class MemoryBudget {
 public:
  /// `limit` in bytes. 0: no limit.
  explicit MemoryBudget(std::int64_t limit) : limit_(limit) {}

  std::int64_t limit() const { return limit_; }
  bool can_ever_fit(std::int64_t bytes) const { return limit_ == 0 || bytes <= limit_; }

  /// Waits until this much memory is free and takes it. Calls `given_up` ten times per second, and returns false if
  /// that returns true first.
  bool take(std::int64_t bytes, const std::function<bool()>& given_up);
  /// Gives back memory that take() has taken.
  void give_back(std::int64_t bytes);

 private:
  const std::int64_t limit_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<const void*> waiting_;
  std::int64_t taken_ = 0;
};

}  // namespace varimesh::server
