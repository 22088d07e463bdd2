// The coarse level of the preconditioner on a device.
#pragma once

#include <vector>

#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/joiner.h"
#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/preconditioner/coarse_level.h"
#include "core/preconditioner/on_device/multigrid_on_device.h"

namespace varimesh {

/// What CoarseLevel does, from memory on the device: the matrix of order 2, its cycle by colours, and the cycle of
/// order 1 below. CoarseLevel numbers the nodes and colours them, and sets multigrid up, on the processor.
class CoarseOnDevice {
 public:
  /// `level` and `cells` must outlive the object.
  CoarseOnDevice(device::Queue& queue, const device::Module* solver, CoarseLevel& level, device::CellsOnDevice& cells);

  /// Whether there are coarse nodes.
  bool is_used() const { return level_.space().count > 0; }
  /// Makes the matrices of both levels from the cells' mean tensors, which CellsOnDevice has computed. The tensors are
  /// copied to the level too.
  void assemble();
  /// The same from the tensors of the level, which a checkpoint has brought.
  void assemble_from_level();

  /// V Iᵀ r, from r of each free node over the number of its cells: d numbers per node, then d zeros.
  void solve(const float* shared);
  /// The result: padded numbers per coarse node; null: there are no coarse nodes.
  const float* solution() const { return x_.as<const float>(); }
  /// The coarse nodes of the cells and the values from them, on the device.
  const device::CoarseSet* sets() const { return sets_.as<const device::CoarseSet>(); }

  std::size_t memory() const;

 private:
  struct Set {
    device::Buffer nodes, stiffness, value_begin, value_column, value_factor;  ///< device::CoarseSet
    device::Buffer begin, column, factor;                                      ///< CoarseLevel::to_coarse()
    std::int64_t first = 0;                                                    ///< Contributions of the sets before.
  };
  void copy_sets();
  void copy_pattern();
  void copy_transfers();
  /// Tells the kernels where the tensors are.
  void point_to_tensors();
  void make_matrix();
  device::CoarseArguments arguments() const;
  /// Runs a kernel on the rows of one colour.
  void run_colour(const device::Kernel& kernel, std::size_t colour);

  device::Queue& queue_;
  CoarseLevel& level_;
  device::CellsOnDevice& cells_on_device_;
  const int dimension_;
  MultigridOnDevice multigrid_;
  device::Kernel factorise_, assemble_, restrict_, add_up_, relax_first_, relax_last_, residual_kernel_, to_vertex_,
      from_vertices_, unscale_;
  std::vector<Set> of_set_;
  device::Buffer sets_, cell_begin_, cells_, places_;
  device::Buffer begin_, column_, row_, entry_, inverse_factor_, right_, x_, residual_;
  device::Buffer above_begin_, above_column_, above_factor_, below_begin_, below_column_, below_factor_;
  std::vector<device::Buffer> tensors_;  ///< By set, if they came from the level.
};

}  // namespace varimesh
