// The graphics card that the process of a job has opened.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/device/card.h"
#include "server/engine/engine.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// The device of a process, opened before the process enters its sandbox: most of what a driver does to begin is
/// refused there. One thread at a time may use it.
class DeviceOfWorker {
 public:
  /// Opens the device, after which this process can open only files of the driver (driver_rules.h).
  /// @param name     as CUDA_VISIBLE_DEVICES names it. Empty: the process gets none, and nothing is opened
  /// @param why_not  RunRequest::why_no_device
  DeviceOfWorker(const std::string& name, std::string why_not);

  bool is_open() const { return held_ != nullptr; }
  /// Whether the driver was opened, which may have started threads.
  bool has_opened_driver() const { return has_opened_driver_; }
  void tell(worker::Started& started) const;

  /// Lets the run have the device. If it has not asked for it by its first iteration, it never will: then the device is
  /// given up, and `unused` is called.
  void add_to(RunHooks& hooks, const RunRequest& request, std::function<void()> unused);
  /// Adds to the result why a run with DeviceChoice::Auto has no device although the server has some.
  void tell(v1::Metrics& metrics) const;

 private:
  device::Possible<std::unique_ptr<device::Device>> open();
  device::Possible<std::unique_ptr<device::Device>> hand_out();

  const std::string why_not_;
  bool has_opened_driver_ = false, is_asked_for_ = false, is_automatic_ = false;
  device::Possible<device::Driver> driver_ = device::fault(device::Fault::Kind::NoDriver, "");
  std::unique_ptr<device::Device> held_;  ///< Keeps the context, so that the run's own device needs no new one.
  device::Fault fault_;                   ///< Why there is none.
};

}  // namespace varimesh::server
