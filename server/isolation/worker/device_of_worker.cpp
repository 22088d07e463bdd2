#include "server/isolation/worker/device_of_worker.h"

#include <cstdlib>
#include <utility>

#include "core/base/utf8.h"
#include "core/device/compiler.h"
#include "core/process/driver_rules.h"

namespace varimesh::server {

using device::Fault;

DeviceOfWorker::DeviceOfWorker(const std::string& name, std::string why_not) : why_not_(std::move(why_not)) {
  fault_ = {Fault::Kind::NoDriver, why_not_};
  if (name.empty()) return;
  // The numbers are those of nvidia-smi. Kernels are compiled at once, and nothing is kept in files.
  ::setenv("CUDA_VISIBLE_DEVICES", name.c_str(), 1);
  ::setenv("CUDA_DEVICE_ORDER", "PCI_BUS_ID", 1);
  ::setenv("CUDA_MODULE_LOADING", "EAGER", 1);
  ::setenv("CUDA_CACHE_DISABLE", "1", 1);
  auto opened = open();
  if (opened)
    held_ = std::move(*opened);
  else
    fault_ = opened.error();
}

device::Possible<std::unique_ptr<device::Device>> DeviceOfWorker::open() {
  if (!open_only_files_of_the_driver())
    return device::fault(
        Fault::Kind::NoDriver,
        "Jobs have no device on this machine, because its kernel cannot keep jobs from files (Landlock, "
        "Linux 5.13).");
  has_opened_driver_ = true;
  driver_ = device::Driver::open();
  if (!driver_) return tl::unexpected(driver_.error());
  auto opened = driver_->use();
  if (opened) device::load_compiler(**opened);
  return opened;
}

void DeviceOfWorker::tell(worker::Started& started) const {
  started.set_has_device(is_open());
  started.set_device(as_plain_text(is_open() ? held_->properties().name : fault_.sentence));
}

device::Possible<std::unique_ptr<device::Device>> DeviceOfWorker::hand_out() {
  is_asked_for_ = true;
  if (!is_open()) return tl::unexpected(fault_);
  return driver_->use();
}

void DeviceOfWorker::add_to(RunHooks& hooks, const RunRequest& request, std::function<void()> unused) {
  if (!is_open() && fault_.sentence.empty()) return;
  is_automatic_ = request.options.device == DeviceChoice::Auto;
  hooks.control.open_device = [this] { return hand_out(); };
  // Runs on a geometry are several, and the first ones may be of other kinds.
  if (!is_open() || request.geometry) return;
  hooks.on_iteration = [this, unused = std::move(unused),
                        next = std::move(hooks.on_iteration)](const Iteration& iteration) {
    if (!is_asked_for_ && is_open()) {
      held_.reset();
      unused();
    }
    return next(iteration);
  };
}

void DeviceOfWorker::tell(v1::Metrics& metrics) const {
  if (is_automatic_ && is_asked_for_ && !why_not_.empty())
    metrics.add_notes("The run was on the processor. " + why_not_);
}

}  // namespace varimesh::server
