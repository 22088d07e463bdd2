// Waiting for memory.
#include "server/resources/memory_budget.h"

#include <algorithm>
#include <chrono>

namespace varimesh::server {

bool MemoryBudget::exchange(std::int64_t held, std::int64_t bytes, const std::function<bool()>& given_up) {
  std::unique_lock lock(mutex_);
  const void* place = &lock;
  const bool holds = held > 0;
  waiting_.insert(holds ? waiting_.begin() + static_cast<std::ptrdiff_t>(holders_) : waiting_.end(), place);
  holders_ += holds ? 1 : 0;
  held_ += held;
  changed_.notify_all();  // perhaps now all that hold memory wait
  const auto is_turn = [&] {
    const bool fits = limit_ == 0 || taken_ - held + bytes <= limit_;
    return waiting_.front() == place && (fits || (holds && taken_ == held_));
  };
  bool gave_up = false;
  while (!gave_up && !changed_.wait_for(lock, std::chrono::milliseconds(100), is_turn)) {
    lock.unlock();
    gave_up = given_up();
    lock.lock();
  }
  waiting_.erase(std::find(waiting_.begin(), waiting_.end(), place));
  holders_ -= holds ? 1 : 0;
  held_ -= held;
  if (!gave_up) taken_ += bytes - held;
  changed_.notify_all();
  return !gave_up;
}

std::int64_t MemoryBudget::take_spare(std::int64_t bytes) {
  std::lock_guard lock(mutex_);
  if (!waiting_.empty()) return 0;
  const std::int64_t free = limit_ == 0 ? bytes : limit_ - taken_;
  const std::int64_t lent = std::clamp<std::int64_t>(free, 0, bytes);
  taken_ += lent;
  return lent;
}

void MemoryBudget::give_back(std::int64_t bytes) {
  std::lock_guard lock(mutex_);
  taken_ -= bytes;
  changed_.notify_all();
}

}  // namespace varimesh::server
