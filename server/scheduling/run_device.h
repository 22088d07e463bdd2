// The device that one attempt at a job has.
#pragma once

#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "core/options/options.h"
#include "server/engine/engine.h"
#include "server/resources/device_budget.h"
#include "server/resources/thread_shares.h"

namespace varimesh::server {

/// Which device the run of a job asks for: none if it makes no steps that a device could make.
inline DeviceChoice device_asked_for(const v1::JobSpec& spec, const Options& options, const Engine& engine) {
  const bool uses = !spec.has_quality() && (!engine.uses_device || engine.uses_device(options));
  return uses ? options.device : DeviceChoice::Cpu;
}

/// The device of a run. A run with DeviceChoice::Gpu waits for one; meanwhile other jobs have its threads. A run with
/// DeviceChoice::Auto takes one that is free, or none.
class DeviceForRun {
 public:
  /// `budget` may be null: the server has no devices.
  explicit DeviceForRun(DeviceBudget* budget) : budget_(budget) {}

  /// Takes a device if the run asks for one. False if the attempt is to end.
  /// @param was_lost  the process of an earlier attempt has ended before its run. Perhaps the device was the cause, so
  ///                  the run gets none
  /// @param waits     called once, before the run waits
  bool take(DeviceChoice choice, bool was_lost, const LentThreads& threads, const std::function<bool()>& given_up,
            const std::function<void(const std::string&)>& waits) {
    if (budget_ == nullptr || budget_->devices() == 0 || choice == DeviceChoice::Cpu) return true;
    if (was_lost) {
      why_not_ = "The process that ran this job before has ended too early, perhaps because of the device.";
      return true;
    }
    place_ = budget_->take_free();
    if (place_ != nullptr) return true;
    if (choice == DeviceChoice::Auto) {
      why_not_ = "All devices of this server were taken when the job began.";
      return true;
    }
    waits("All devices of this server are taken; the job waits for one.");
    threads.rest(true);
    const auto began = std::chrono::steady_clock::now();
    place_ = budget_->take(given_up);
    threads.rest(false);
    waited_ = std::chrono::steady_clock::now() - began;
    return place_ != nullptr;
  }

  /// Tells the run which device it has, or why it has none.
  void tell(RunRequest& request) const {
    if (place_ != nullptr) request.device = place_->device();
    request.why_no_device = why_not_;
  }

  /// The run does not use it.
  void give_back() { place_.reset(); }

  /// Adds to the result how long the job has waited.
  void tell(v1::Metrics& metrics) const {
    if (waited_ <= std::chrono::steady_clock::duration::zero()) return;
    const auto seconds = std::llround(std::ceil(std::chrono::duration<double>(waited_).count()));
    metrics.add_notes("The job waited " + std::to_string(seconds) + " s for a device of this server.");
  }

 private:
  DeviceBudget* const budget_;
  std::unique_ptr<DeviceBudget::Place> place_;
  std::string why_not_;
  std::chrono::steady_clock::duration waited_{};
};

}  // namespace varimesh::server
