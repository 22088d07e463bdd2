// The device of one run: which it is, and why it is used no more.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/device/device.h"

namespace varimesh::device {

/// A run begins with a device or without one. After a fault of its device it goes on without.
class RunDevice {
 public:
  RunDevice() = default;
  explicit RunDevice(std::unique_ptr<Device> device) : device_(std::move(device)) {}

  /// The device as long as it is used; null: there is none.
  Device* get() const { return fault_ ? nullptr : device_.get(); }
  /// Empty if the run began without a device.
  std::string name() const { return device_ == nullptr ? "" : device_->properties().name; }

  /// The work has begun on the device.
  void begin() { has_begun_ = true; }
  bool has_begun() const { return has_begun_; }

  /// It is used no more. The device lives on until the object ends, for those who still hold memory on it.
  void give_up(const Fault& fault) { fault_ = fault; }
  /// Why it was given up.
  const std::optional<Fault>& fault() const { return fault_; }

 private:
  std::unique_ptr<Device> device_;
  bool has_begun_ = false;
  std::optional<Fault> fault_;
};

}  // namespace varimesh::device
