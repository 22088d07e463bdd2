// How much of the machine's memory the running jobs may have together.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <mutex>

namespace varimesh::server {

/// Gives memory to jobs in the order in which they ask: one that waits is not overtaken by smaller ones.
class MemoryBudget {
 public:
  /// `limit` 0: there is none.
  explicit MemoryBudget(std::int64_t limit) : limit_(limit) {}

  std::int64_t limit() const { return limit_; }
  bool can_ever_fit(std::int64_t bytes) const { return limit_ == 0 || bytes <= limit_; }

  /// Waits until so much is free; false where `given_up`, asked a few times a second, said so first.
  bool take(std::int64_t bytes, const std::function<bool()>& given_up);
  /// What take() gave.
  void give_back(std::int64_t bytes);

 private:
  const std::int64_t limit_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<const void*> waiting_;
  std::int64_t taken_ = 0;
};

/// 9/10 of what this machine has, or of what the control group that the process is in may have, or one of those round
/// it (version 1 or 2); 0 where that cannot be found out. `root`: where /proc and /sys/fs/cgroup are.
std::int64_t machine_memory(const std::filesystem::path& root = "/");

}  // namespace varimesh::server
