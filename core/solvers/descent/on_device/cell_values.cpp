#include "core/solvers/descent/on_device/cell_values.h"

#include <algorithm>

#include "core/kernels/hessian/batch.h"

namespace varimesh {
namespace {

std::int32_t power(std::int32_t base, int exponent) {
  std::int32_t result = 1;
  for (int i = 0; i < exponent; ++i) result *= base;
  return result;
}

}  // namespace

MatrixOnDevice copy_matrix(device::Queue& queue, const detail::LaneMatrix& matrix) {
  MatrixOnDevice copied;
  const bool is_whole = matrix.axes == 0;
  copied.rows = static_cast<std::int32_t>(is_whole ? matrix.rows : matrix.factor_rows);
  copied.columns = static_cast<std::int32_t>(is_whole ? matrix.columns : matrix.factor_columns);
  copied.axes = static_cast<int>(matrix.axes);
  queue.fill(copied.numbers, matrix.numbers);
  return copied;
}

CellValues::CellValues(device::Queue& queue, const device::Module* descent, std::size_t numbers)
    : queue_(queue),
      multiply_cells_(queue.kernel(descent, "multiply_cells")),
      now_(queue.room(numbers * sizeof(double))),
      next_(queue.room(numbers * sizeof(double))) {}

void CellValues::multiply(const MatrixOnDevice& matrix, std::int32_t batches) {
  for (int axis = 0; axis < std::max(1, matrix.axes); ++axis) {
    multiply_axis(matrix, batches, axis, next(), false);
    swap();
  }
}

void CellValues::multiply_into(const MatrixOnDevice& matrix, std::int32_t batches, double* to) {
  const int last = std::max(1, matrix.axes) - 1;
  for (int axis = 0; axis < last; ++axis) {
    multiply_axis(matrix, batches, axis, next(), false);
    swap();
  }
  multiply_axis(matrix, batches, last, to, true);
}

void CellValues::multiply_axis(const MatrixOnDevice& matrix, std::int32_t batches, int axis, double* to, bool by_lane) {
  device::CellMatrixArguments a;
  a.batches = batches;
  a.rows = matrix.rows;
  a.columns = matrix.columns;
  if (matrix.axes > 0) {
    a.inner = power(matrix.rows, axis);
    a.outer = power(matrix.columns, matrix.axes - 1 - axis);
  }
  a.by_lane = by_lane ? 1 : 0;
  a.matrix = matrix.numbers.as<const double>();
  a.from = now();
  a.to = to;
  const std::int64_t groups = (a.rows + device::kRowsOfThread - 1) / device::kRowsOfThread;
  queue_.launch(multiply_cells_, std::int64_t{kBatch} * batches * groups * a.outer * a.inner, a);
}

}  // namespace varimesh
