// Cells whose nodes are split among a few threads, which keep their numbers in registers: a set of one shape and order
// for which there are kernels.
#pragma once

#include <utility>

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/splits.h"
#include "core/device_kernels/set_on_device.h"
#include "core/device_kernels/split_tables.h"

namespace varimesh::device {

class SplitCells final : public SetOnDevice {
 public:
  /// @param tables  of the set
  SplitCells(Device& device, const SetPlace& place, SplitTables tables)
      : SetOnDevice(device, place), tables_(std::move(tables)) {}

  Possible<void> copy(const Module& kernels, const Module& general) override;
  Possible<void> scan(const SharedArrays& shared) override;
  Possible<void> gradient(const SharedArrays& shared, bool keeps) override;
  Possible<void> product(const SharedArrays& shared) override;
  std::size_t memory() const override;

 private:
  template <class T>
  CellTables<T> tables(const Buffer& derivatives) const;
  CellArguments arguments(const SharedArrays& shared, const Buffer& derivatives) const;
  /// As many threads as the cells have parts, with a table in shared memory.
  Launch launch_with(CellKernel kernel, const Buffer& derivatives) const;

  SplitTables tables_;
  Kernel energy_, gradient_, linearise_, product_;
  Buffer energy_table_, gradient_table_, product_table_;
  Buffer nodes_by_column_, slots_by_point_;  ///< CellTables::nodes and CellTables::slots; empty: a simplex.
};

}  // namespace varimesh::device
