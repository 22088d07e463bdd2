// multiply_lanes() for kernels that go on with its result.
#if defined(VARIMESH_KERNELS_DENSE_LANE_MATRIX_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_KERNELS_DENSE_LANE_MATRIX_INL_H
#undef VARIMESH_KERNELS_DENSE_LANE_MATRIX_INL_H
#else
#define VARIMESH_KERNELS_DENSE_LANE_MATRIX_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "core/kernels/dense/lane_matrix.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::lanes::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<double, kCellLanes>;
using V = hn::Vec<Tag>;

/// Rows of a matrix that are multiplied at the same time.
constexpr std::size_t kRows = 4;

/// out = matrix · in for kRows rows (or fewer, `rows`) and one vector of lanes. Strides count [direction][lane] blocks.
template <std::size_t D>
HWY_INLINE void MultiplyRows(const double* HWY_RESTRICT matrix, std::size_t rows, std::size_t columns,
                             const double* HWY_RESTRICT in, std::size_t in_stride, double* HWY_RESTRICT out,
                             std::size_t out_stride) {
  const Tag tag;
  const double* row[kRows];
  for (std::size_t r = 0; r < kRows; ++r) row[r] = matrix + std::min(r, rows - 1) * columns;
  V a[D], b[D], c[D], e[D];
  for (std::size_t k = 0; k < D; ++k) a[k] = b[k] = c[k] = e[k] = hn::Zero(tag);
  for (std::size_t n = 0; n < columns; ++n, in += in_stride * D * kCellLanes) {
    const V p = hn::Set(tag, row[0][n]), q = hn::Set(tag, row[1][n]), r = hn::Set(tag, row[2][n]),
            s = hn::Set(tag, row[3][n]);
    for (std::size_t k = 0; k < D; ++k) {
      const V x = hn::LoadU(tag, in + k * kCellLanes);
      a[k] = hn::MulAdd(p, x, a[k]);
      b[k] = hn::MulAdd(q, x, b[k]);
      c[k] = hn::MulAdd(r, x, c[k]);
      e[k] = hn::MulAdd(s, x, e[k]);
    }
  }
  const V* const sums[kRows] = {a, b, c, e};
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t k = 0; k < D; ++k) hn::StoreU(sums[r][k], tag, out + (r * out_stride * D + k) * kCellLanes);
}

template <std::size_t D>
HWY_INLINE void MultiplyAll(const double* matrix, std::size_t rows, std::size_t columns, const double* HWY_RESTRICT in,
                            std::size_t in_stride, double* HWY_RESTRICT out, std::size_t out_stride) {
  for (std::size_t first = 0; first < rows; first += kRows)
    MultiplyRows<D>(matrix + first * columns, std::min(kRows, rows - first), columns, in, in_stride,
                    out + first * out_stride * D * kCellLanes, out_stride);
}

/// Copies or clears one vector of lanes in each direction.
template <std::size_t D>
HWY_INLINE void CopyPlace(const double* HWY_RESTRICT from, double* HWY_RESTRICT to) {
  for (std::size_t k = 0; k < D; ++k)
    hn::StoreU(from == nullptr ? hn::Zero(Tag()) : hn::LoadU(Tag(), from + k * kCellLanes), Tag(), to + k * kCellLanes);
}

/// The product over D axes: one axis after another.
template <std::size_t D>
HWY_INLINE void MultiplyAxes(const LaneMatrix& matrix, const double* HWY_RESTRICT in, double* HWY_RESTRICT out,
                             double* room) {
  constexpr std::size_t kPlace = D * kCellLanes;
  const std::size_t n = matrix.factor_rows, m = matrix.factor_columns;
  std::size_t inner = 1, outer = 1;
  for (std::size_t a = 0; a < D; ++a) outer *= m;
  double* from = room;
  double* to = room + matrix.room(D) / 2;
  if (matrix.columns < outer)
    for (std::size_t place = 0; place < outer; ++place) CopyPlace<D>(nullptr, from + place * kPlace);
  for (std::size_t c = 0; c < matrix.columns; ++c)
    CopyPlace<D>(in + c * kPlace, from + matrix.column_places[c] * kPlace);
  for (std::size_t a = 0; a < D; ++a, inner *= n, std::swap(from, to)) {
    outer /= m;
    for (std::size_t o = 0; o < outer; ++o)
      for (std::size_t i = 0; i < inner; ++i)
        MultiplyAll<D>(matrix.numbers.data(), n, m, from + (o * m * inner + i) * kPlace, inner,
                       to + (o * n * inner + i) * kPlace, inner);
  }
  for (std::size_t r = 0; r < matrix.rows; ++r) CopyPlace<D>(from + matrix.row_places[r] * kPlace, out + r * kPlace);
}

/// multiply_lanes() for the vector of lanes that begins at `in`, `out` and `room`.
template <std::size_t D>
HWY_INLINE void MultiplyVector(const LaneMatrix& matrix, const double* HWY_RESTRICT in, double* HWY_RESTRICT out,
                               double* room) {
  if (matrix.axes > 0)
    MultiplyAxes<D>(matrix, in, out, room);
  else
    MultiplyAll<D>(matrix.numbers.data(), matrix.rows, matrix.columns, in, 1, out, 1);
}

}  // namespace varimesh::detail::lanes::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
