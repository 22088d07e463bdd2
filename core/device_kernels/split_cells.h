// Cells whose nodes are split among a few threads, which keep their numbers in registers: a set of one shape and order
// for which there are kernels, with targets that are constant in each cell.
#pragma once

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/splits.h"
#include "core/device_kernels/set_on_device.h"

namespace varimesh::device {

class SplitCells final : public SetOnDevice {
 public:
  using SetOnDevice::SetOnDevice;

  Possible<void> copy(const Module& kernels, const Module& general) override;
  Possible<void> scan(const SharedArrays& shared) override;
  Possible<void> gradient(const SharedArrays& shared, bool keeps) override;
  Possible<void> product(const SharedArrays& shared) override;
  std::size_t memory() const override;

 private:
  CellArguments arguments(const SharedArrays& shared, const Buffer& table) const;
  /// As many threads as the cells have parts, with a table in shared memory.
  Launch launch_with(CellKernel kernel, const Buffer& table) const;

  Kernel energy_, gradient_, linearise_, product_;
  Buffer energy_table_, gradient_table_, product_table_;
};

}  // namespace varimesh::device
