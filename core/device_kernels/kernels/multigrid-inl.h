// The cycle of order 1 (core/preconditioner/multigrid) row by row, and the groups of stretched cells
// (core/preconditioner/stretched_cells.h).
#if defined(VARIMESH_DEVICE_MULTIGRID_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_MULTIGRID_INL_H
#undef VARIMESH_DEVICE_MULTIGRID_INL_H
#else
#define VARIMESH_DEVICE_MULTIGRID_INL_H
#endif

#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/number-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// Adds a row of a sparse matrix times d vectors.
template <int d>
HWY_INLINE void add_row(const std::int64_t* begin, const std::int32_t* column, const float* value, std::int64_t row,
                        const double* from, double (&sum)[d]) {
  for (std::int64_t e = begin[row]; e < begin[row + 1]; ++e) {
    const double* of_column = from + static_cast<std::int64_t>(column[e]) * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
      sum[k] = __builtin_fma(static_cast<double>(value[e]), of_column[k], sum[k]);
    }
  }
}

/// One step of the Chebyshev smoother (core/preconditioner/multigrid/chebyshev.h).
template <int d>
HWY_INLINE void smooth_row(const device::LevelArguments& a, std::int64_t row) {
  if (row >= a.rows) return;
  double sum[d] = {};
  if (a.is_zero == 0) add_row<d>(a.begin, a.column, a.value, row, a.now, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const std::int64_t at = row * d + k;
    const double own = a.is_zero != 0 ? 0.0 : a.now[at];
    const double before = a.was_zero != 0 ? 0.0 : a.next[at];
    const double rest = __builtin_fma(-a.diagonal[row], own, a.right[at]) - sum[k];
    a.next[at] = own + a.momentum * (own - before) + a.step * a.inverse[row] * rest;
  }
}

/// b − A x
template <int d>
HWY_INLINE void residual_row(const device::LevelArguments& a, std::int64_t row) {
  if (row >= a.rows) return;
  double sum[d] = {};
  add_row<d>(a.begin, a.column, a.value, row, a.now, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    a.next[row * d + k] = __builtin_fma(-a.diagonal[row], a.now[row * d + k], a.right[row * d + k]) - sum[k];
  }
}

/// A row of a transfer between levels.
template <int d>
HWY_INLINE void transfer_row(const device::RowsArguments& a, std::int64_t row) {
  if (row >= a.rows) return;
  double sum[d] = {};
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = a.adds != 0 ? a.to[row * d + k] : 0.0; }
  add_row<d>(a.begin, a.column, a.value, row, a.from, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.to[row * d + k] = sum[k]; }
}

/// A row of the inverse on the coarsest level.
template <int d>
HWY_INLINE void dense_row(const device::DenseArguments& a, std::int64_t row) {
  if (row >= a.rows) return;
  double sum[d] = {};
  for (std::int64_t j = 0; j < a.rows; ++j) {
    // The matrix is symmetric: neighbouring threads read neighbouring numbers.
    const double entry = a.matrix[j * a.rows + row];
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = __builtin_fma(entry, a.from[j * d + k], sum[k]); }
  }
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.to[row * d + k] = sum[k]; }
}

/// L⁻¹ W r in one row of a group. Returns its square.
HWY_INLINE double group_value(const device::GroupArguments& a, std::int64_t row) {
  if (row >= a.rows) return 0;
  const std::int64_t first = a.first[row], own = row - first;
  const float* factor = a.triangles + a.factor[row] + own * (own + 1) / 2;
  float sum = 0;
  for (std::int64_t j = 0; j <= own; ++j)
    sum = __builtin_fmaf(factor[j], a.weight[first + j] * a.residual[a.unknown[first + j]], sum);
  a.value[row] = sum;
  return static_cast<double>(sum) * static_cast<double>(sum);
}

/// W L⁻ᵀ of the values in one row of a group.
HWY_INLINE void group_product(const device::GroupArguments& a, std::int64_t row) {
  if (row >= a.rows) return;
  const std::int64_t first = a.first[row], own = row - first;
  float sum = 0;
  for (std::int64_t i = own; first + i < a.end[row]; ++i)
    sum = __builtin_fmaf(a.triangles[a.factor[row] + i * (i + 1) / 2 + own], a.value[first + i], sum);
  a.product[row] = a.weight[row] * sum;
}

/// Adds the groups of one unknown to z, in their order.
HWY_INLINE void add_groups(const device::GroupArguments& a, std::int64_t i) {
  if (i >= a.unknowns) return;
  float sum = a.z[a.own[i]];
  for (std::int32_t e = a.begin[i]; e < a.begin[i + 1]; ++e) sum = sum + a.product[a.rows_of[e]];
  a.z[a.own[i]] = sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
