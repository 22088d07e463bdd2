// The device of one run: which it is, and why it is used no more.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/device/device.h"

namespace varimesh::device {

/// A run begins with a device or without one. After a fault that ends its device it goes on without. After any other
/// fault the work that met it is done elsewhere, and the next work is given to the device again.
class RunDevice {
 public:
  RunDevice() = default;
  explicit RunDevice(std::unique_ptr<Device> device) : device_(std::move(device)) {}

  /// The device as long as it is used; null: there is none.
  Device* get() const { return has_ended() ? nullptr : device_.get(); }

  /// A part of the work has been done on the device.
  void begin() { done_on_ = device_->properties().name; }
  /// A part of the work has been done on a device of this name, before a checkpoint from which the run goes on.
  void began_on(std::string name) { done_on_ = std::move(name); }
  /// The name of the device on which a part of the work was done; empty: there was none.
  const std::string& done_on() const { return done_on_; }

  /// A part of the work is done elsewhere. The device lives on until the object ends, for those who still hold memory
  /// on it.
  void give_up(const Fault& fault) {
    if (!fault_ || ends(fault)) fault_ = fault;
  }
  /// Why a part of the work was done elsewhere: the fault that ended the device, or else the first one.
  const std::optional<Fault>& fault() const { return fault_; }
  /// Whether the device is used no more.
  bool has_ended() const { return fault_ && ends(*fault_); }

 private:
  /// Other work may need less memory, or other kernels.
  static bool ends(const Fault& fault) {
    return fault.kind != Fault::Kind::OutOfMemory && fault.kind != Fault::Kind::NoKernels;
  }

  std::unique_ptr<Device> device_;
  std::string done_on_;
  std::optional<Fault> fault_;
};

}  // namespace varimesh::device
