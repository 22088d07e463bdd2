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
  bool take(std::int64_t bytes, const std::function<bool()>& given_up) { return exchange(0, bytes, given_up); }
  /// The same for a job that has `held` bytes and needs `bytes` in place of them. It keeps what it holds while it
  /// waits, and also if it gives up. Such jobs are served before those that hold nothing. Once all jobs that have
  /// memory wait for more, none of them could ever go on: then the first gets what it needs although the others keep
  /// theirs.
  bool exchange(std::int64_t held, std::int64_t bytes, const std::function<bool()>& given_up);
  /// Takes as much of this as is free, at once, and returns how much that is. None if a job waits for memory.
  std::int64_t take_spare(std::int64_t bytes);
  /// Gives back memory that take(), exchange() or take_spare() has taken.
  void give_back(std::int64_t bytes);

 private:
  const std::int64_t limit_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<const void*> waiting_;  ///< First those that hold memory.
  std::size_t holders_ = 0;          ///< How many of them do, and
  std::int64_t held_ = 0;            ///< how much.
  std::int64_t taken_ = 0;           ///< By all, those that wait included.
};

}  // namespace varimesh::server
