#include "core/device_kernels/judge/judge_on_device.h"

#include <utility>

#include "core/device_kernels/cell_modules.h"

namespace varimesh {

bool JudgeOnDevice::begin() {
  device::Device* const there = used_device();
  if (there == nullptr) return false;
  queue_.emplace(*there);
  if (module_) return true;
  auto module = queue_->load(device::judge_kernels(dimension_));
  for (const auto& [name, kernel] :
       {std::pair<const char*, device::Kernel*>{"relative_nodes", &kernels_.relative_nodes},
        {"convert", &kernels_.convert},
        {"differentiate", &kernels_.differentiate},
        {"cross", &kernels_.cross},
        {"coefficients", &kernels_.coefficients},
        {"measure", &kernels_.measure},
        {"sample", &kernels_.sample}})
    *kernel = queue_->kernel(module.get(), name);
  if (queue_->is_well()) module_ = std::move(module);
  return is_well();
}

bool JudgeOnDevice::is_well() {
  if (queue_->is_well()) return true;
  if (run_ != nullptr) run_->give_up(*queue_->fault());
  return false;
}

bool JudgeOnDevice::take(std::span<const double> coordinates) {
  if (!begin()) return false;
  queue_->fill(coordinates_, coordinates);
  return is_well();
}

void JudgeOnDevice::forget() {
  coordinates_ = device::Buffer();
  tables_.clear();
  work_ = Work();
}

}  // namespace varimesh
