// The cycle of multigrid on a device.
#pragma once

#include <vector>

#include "core/device_kernels/joiner.h"
#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/preconditioner/multigrid/multigrid.h"

namespace varimesh {

/// What Multigrid::apply() does, from memory on the device. Multigrid sets itself up on the processor; its levels are
/// copied.
class MultigridOnDevice {
 public:
  /// @param solver   the module of device::solver_kernels()
  /// @param columns  as in Multigrid::apply(): the dimension of the kernels
  MultigridOnDevice(device::Queue& queue, const device::Module* solver, int columns);

  /// Copies the levels.
  void copy(const Multigrid& multigrid);

  /// Where apply() finds its right side and leaves the solution: rows × columns.
  double* right() const { return levels_.front().right.as<double>(); }
  const double* solution() const { return levels_.front().solution.as<const double>(); }
  void apply();

  std::size_t memory() const;

 private:
  struct Rows {
    std::int32_t rows = 0;
    device::Buffer begin, column, value;
  };
  struct Level {
    Rows matrix, prolongator, restrictor;
    device::Buffer diagonal, inverse, right, solution, scratch;
    double largest = 0;
  };
  template <class Matrix>
  void copy_rows(const Matrix& from, Rows& to);
  /// A kernel's arguments for the rows of a level: it reads `now` and writes `next`.
  static device::LevelArguments arguments_of(const Level& level, const device::Buffer& now, const device::Buffer& next);
  void cycle(std::size_t number);
  void smooth(Level& level, bool from_zero);
  void transfer(const Rows& rows, const device::Buffer& from, const device::Buffer& to, bool adds);

  device::Queue& queue_;
  const int columns_;
  device::Kernel smooth_row_, residual_row_, transfer_row_, dense_row_;
  std::vector<Level> levels_;
  device::Buffer dense_;  ///< The inverse on the last level; empty: it is only smoothed.
};

}  // namespace varimesh
