// Waiting for memory.
#include "server/resources/memory_budget.h"

#include <algorithm>
#include <chrono>

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

}  // namespace varimesh::server
