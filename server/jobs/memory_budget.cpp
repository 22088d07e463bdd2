#include "server/jobs/memory_budget.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>

namespace varimesh::server {

bool MemoryBudget::take(std::int64_t bytes, const std::function<bool()>& given_up) {
  std::unique_lock lock(mutex_);
  const void* place = &lock;
  waiting_.push_back(place);
  const auto is_turn = [&] { return waiting_.front() == place && (limit_ == 0 || taken_ + bytes <= limit_); };
  bool gave_up = false;
  while (!gave_up && !changed_.wait_for(lock, std::chrono::milliseconds(100), is_turn)) {
    lock.unlock();
    gave_up = given_up();
    lock.lock();
  }
  waiting_.erase(std::find(waiting_.begin(), waiting_.end(), place));
  if (!gave_up) taken_ += bytes;
  changed_.notify_all();
  return !gave_up;
}

void MemoryBudget::give_back(std::int64_t bytes) {
  std::lock_guard lock(mutex_);
  taken_ -= bytes;
  changed_.notify_all();
}

std::int64_t machine_memory() {
  std::int64_t memory = static_cast<std::int64_t>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGESIZE);
  std::int64_t group = 0;
  if (std::ifstream file("/sys/fs/cgroup/memory.max"); file >> group && group > 0) memory = std::min(memory, group);
  return memory > 0 ? memory / 10 * 9 : 0;
}

}  // namespace varimesh::server
