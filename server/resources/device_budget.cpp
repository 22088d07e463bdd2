// Waiting for a device.
#include "server/resources/device_budget.h"

#include <algorithm>
#include <chrono>
#include <numeric>

namespace varimesh::server {

int DeviceBudget::busy() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<int>(std::ranges::count_if(jobs_, [](int jobs) { return jobs > 0; }));
}

int DeviceBudget::jobs() const {
  const std::scoped_lock lock(mutex_);
  return std::accumulate(jobs_.begin(), jobs_.end(), 0);
}

std::unique_ptr<DeviceBudget::Place> DeviceBudget::take_free() {
  const std::scoped_lock lock(mutex_);
  const std::size_t device = free_device();
  return waiting_.empty() && device < devices_.size() ? place_on(device) : nullptr;
}

std::unique_ptr<DeviceBudget::Place> DeviceBudget::take(const std::function<bool()>& given_up) {
  std::unique_lock lock(mutex_);
  const std::uint64_t own = next_++;
  waiting_.push_back(own);
  const auto is_turn = [&] { return waiting_.front() == own && free_device() < devices_.size(); };
  bool gave_up = false;
  while (!gave_up && !changed_.wait_for(lock, std::chrono::milliseconds(100), is_turn)) {
    lock.unlock();
    gave_up = given_up();
    lock.lock();
  }
  std::erase(waiting_, own);
  changed_.notify_all();
  return gave_up ? nullptr : place_on(free_device());
}

std::size_t DeviceBudget::free_device() const {
  const auto least = std::ranges::min_element(jobs_);
  return least == jobs_.end() || *least >= jobs_each_ ? devices_.size()
                                                      : static_cast<std::size_t>(least - jobs_.begin());
}

std::unique_ptr<DeviceBudget::Place> DeviceBudget::place_on(std::size_t device) {
  ++jobs_[device];
  return std::unique_ptr<Place>(new Place(*this, device));
}

void DeviceBudget::give_back(std::size_t device) {
  const std::scoped_lock lock(mutex_);
  --jobs_[device];
  changed_.notify_all();
}

}  // namespace varimesh::server
