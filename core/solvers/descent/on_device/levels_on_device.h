// The preconditioner of the descent on a device.
#pragma once

#include <vector>

#include "core/device_kernels/joiner.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/solvers/descent/on_device/cell_values.h"
#include "core/solvers/descent/on_device/space_on_device.h"

namespace varimesh {

/// What OrderLevels::apply() does, from memory on the device. OrderLevels takes the diagonals on the processor.
class LevelsOnDevice {
 public:
  /// @param descent        the module of device::descent_kernels()
  /// @param contributions  room for those of all cells, which apply() overwrites
  /// All other arguments are kept by reference and must outlive the object.
  LevelsOnDevice(device::Queue& queue, const device::Module* descent, const Problem& problem, const OrderLevels& levels,
                 CellValues& values, double* contributions, device::Joiner& joiner, const Team& team);

  /// The maps of the problem's own order.
  const SpaceOnDevice& own() const { return levels_.back().space; }

  /// Copies the diagonals of the levels.
  void take_diagonals();

  /// z = M⁻¹ r, d numbers per free node each. Returns r · z.
  double apply(double* r, double* z);

  std::size_t memory() const;

 private:
  struct Level {
    SpaceOnDevice space;
    device::Buffer inverse;             ///< Of the diagonal.
    device::Buffer residual, solution;  ///< Empty in the problem's own order.
    /// By set: values at the nodes of the next order from those at the nodes of this one, and back.
    std::vector<MatrixOnDevice> there, back;
  };
  /// Sets the contributions of all cells: a matrix times a vector of a space.
  void multiply(const SpaceOnDevice& space, const double* vector, bool only_first,
                const std::vector<MatrixOnDevice>& matrices, const SpaceOnDevice& to);

  device::Queue& queue_;
  const Problem& problem_;
  const OrderLevels& source_;
  CellValues& values_;
  double* const contributions_;
  device::Joiner& joiner_;
  device::Kernel gather_values_, add_up_residual_, correct_;
  std::vector<Level> levels_;  ///< By order, from 1.
};

}  // namespace varimesh
