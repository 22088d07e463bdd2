// The graphics cards that a server lends to its jobs: at most one to each running job.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace varimesh::server {

/// Lends devices to jobs. A job gets the device that the fewest jobs have. Jobs that wait get devices in the order in
/// which they have asked, and nobody passes them. Thread-safe.
class DeviceBudget {
 public:
  /// The place of a job on a device, until the object is destroyed.
  class Place {
   public:
    ~Place() { budget_.give_back(device_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    /// As CUDA_VISIBLE_DEVICES names the device.
    const std::string& device() const { return budget_.devices_[device_]; }

   private:
    friend class DeviceBudget;
    Place(DeviceBudget& budget, std::size_t device) : budget_(budget), device_(device) {}

    DeviceBudget& budget_;
    const std::size_t device_;
  };

  /// @param devices    as CUDA_VISIBLE_DEVICES names each; empty: there is none
  /// @param jobs_each  how many jobs may have the same device at a time
  explicit DeviceBudget(std::vector<std::string> devices = {}, int jobs_each = 1)
      : devices_(std::move(devices)), jobs_each_(jobs_each), jobs_(devices_.size()) {}

  int devices() const { return static_cast<int>(devices_.size()); }
  /// How many jobs may have a device at a time.
  int most_jobs() const { return devices() * jobs_each_; }
  /// Devices that a job has.
  int busy() const;
  /// Jobs that have a device.
  int jobs() const;

  /// A place if one is free and nobody waits; otherwise null.
  std::unique_ptr<Place> take_free();
  /// Waits for a place. `given_up` is called ten times per second; null if that returned true first. There must be a
  /// device.
  std::unique_ptr<Place> take(const std::function<bool()>& given_up);

 private:
  /// The device that the fewest jobs have, if it takes one more; otherwise devices_.size().
  std::size_t free_device() const;
  void give_back(std::size_t device);
  std::unique_ptr<Place> place_on(std::size_t device);

  const std::vector<std::string> devices_;
  const int jobs_each_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> jobs_;              ///< That have each device.
  std::deque<std::uint64_t> waiting_;  ///< In the order in which they have asked.
  std::uint64_t next_ = 0;
};

}  // namespace varimesh::server
