// The groups of stretched cells on a device.
#pragma once

#include "core/device_kernels/joiner.h"
#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/preconditioner/stretched_cells.h"

namespace varimesh {

/// What StretchedCells::add() does, from memory on the device. StretchedCells makes the factors; they are copied.
class GroupsOnDevice {
 public:
  GroupsOnDevice(device::Queue& queue, const device::Module* solver, int dimension);

  void copy(const StretchedCells& stretched);

  /// Adds the groups' part of M⁻¹ r to z. Returns r · what is added.
  double add(const float* residual, float* z, device::Joiner& joiner);

  std::size_t memory() const;

 private:
  device::Queue& queue_;
  const int dimension_;
  device::Kernel value_kernel_, product_kernel_, add_kernel_;
  std::int32_t rows_ = 0, unknowns_ = 0;
  device::Buffer first_, end_, factor_, triangles_, unknown_, weight_, value_, product_, own_, begin_, rows_of_;
};

}  // namespace varimesh
