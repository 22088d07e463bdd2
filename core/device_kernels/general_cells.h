// Cells of any shape and order, with any targets: kernels that work point by point, then node by node.
#pragma once

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/set_on_device.h"

namespace varimesh::device {

class GeneralCells final : public SetOnDevice {
 public:
  using SetOnDevice::SetOnDevice;

  Possible<void> copy(const Module& kernels, const Module& general) override;
  Possible<void> scan(const SharedArrays& shared) override;
  Possible<void> gradient(const SharedArrays& shared, bool keeps) override;
  Possible<void> product(const SharedArrays& shared) override;
  std::size_t memory() const override { return SetOnDevice::memory() + fields_.bytes(); }

 private:
  GeneralArguments arguments(const SharedArrays& shared) const;

  Kernel deform_, scan_, range_, stress_, linearise_, gradient_, change_stress_, product_;
  Buffer fields_;  ///< F, then the stress or its change, at every point.
};

}  // namespace varimesh::device
