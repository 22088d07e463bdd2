// Values at the nodes or modes of all cells of a set on a device, and their products with matrices of the reference
// cell.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/device/queue.h"
#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/kernels/dense/lane_matrix.h"

namespace varimesh {

/// A LaneMatrix on a device. Its columns and rows are numbered by place: those of a product over axes as
/// LaneMatrix::column_places and row_places say, all others in their own order.
struct MatrixOnDevice {
  std::int32_t rows = 0, columns = 0;  ///< Of the matrix, or of its factor.
  int axes = 0;                        ///< LaneMatrix::axes.
  device::Buffer numbers;
};
MatrixOnDevice copy_matrix(device::Queue& queue, const detail::LaneMatrix& matrix);

/// Room for the values of any set of a problem, batches × place × d × lane, and again for those that are made of them.
class CellValues {
 public:
  /// @param descent  the module of device::descent_kernels()
  /// @param numbers  of the largest set that it will hold
  CellValues(device::Queue& queue, const device::Module* descent, std::size_t numbers);

  /// Where the values are, and where kernels may write others: swap() makes these the values.
  double* now() const { return now_.as<double>(); }
  double* next() const { return next_.as<double>(); }
  void swap() { std::swap(now_, next_); }

  /// Multiplies the values in `batches` batches of cells with a matrix.
  void multiply(const MatrixOnDevice& matrix, std::int32_t batches);
  /// The same, and writes the result, batches × place × lane × d, to `to`. The values have no meaning after that.
  void multiply_into(const MatrixOnDevice& matrix, std::int32_t batches, double* to);

  std::size_t memory() const { return now_.bytes() + next_.bytes(); }

 private:
  /// Multiplies along one axis.
  void multiply_axis(const MatrixOnDevice& matrix, std::int32_t batches, int axis, double* to, bool by_lane);

  device::Queue& queue_;
  device::Kernel multiply_cells_;
  device::Buffer now_, next_;
};

}  // namespace varimesh
