// The kernels that judge cells. Each function is one thread. Threads are numbered row by row, the lane innermost, or
// cell by cell.
#if defined(VARIMESH_DEVICE_JUDGE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_JUDGE_INL_H
#undef VARIMESH_DEVICE_JUDGE_INL_H
#else
#define VARIMESH_DEVICE_JUDGE_INL_H
#endif

#include "core/device_kernels/kernels/descent/form-inl.h"
#include "core/device_kernels/kernels/judge/arguments.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/quality/lattice-inl.h"
#include "core/validity/formulas/coefficients-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {
namespace judge {

namespace validity = ::varimesh::detail::HWY_NAMESPACE;
namespace lattice = ::varimesh::detail::lattice::HWY_NAMESPACE;
using descent::RowOfCell;

/// Where the numbers of a row of a thread's cell begin, of `width` numbers with kBatch lanes each.
HWY_INLINE std::int64_t row_at(const RowOfCell& own, int rows, int row, int width) {
  return (own.batch * rows + row) * width * kBatch + own.lane;
}

/// A node of a cell relative to the cell's first node.
template <int d>
HWY_INLINE void relative_node(const device::RelativeArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.nodes);
  if (own.batch * kBatch >= a.cells) return;
  const std::int64_t number = own.batch * kBatch + own.lane, cell = number < a.cells ? number : a.cells - 1;
  const std::int32_t* list = a.lists + cell * a.nodes;
  const double* x = a.coordinates + 3 * static_cast<std::int64_t>(list[own.own]);
  const double* origin = a.coordinates + 3 * static_cast<std::int64_t>(list[0]);
  double* to = a.to + row_at(own, a.nodes, own.own, d);
  VARIMESH_UNROLLED for (int c = 0; c < d; ++c) { to[c * kBatch] = (x[c] - origin[c]) * a.scale; }
}

// ===== Coefficients =====

HWY_INLINE validity::Entries entries_of(const device::RowArguments& a, int row) {
  return {a.start[row], a.start[row + 1]};
}

/// A scaled coefficient of the map.
template <int d>
HWY_INLINE void convert_row(const device::RowArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.rows);
  if (own.batch >= a.batches) return;
  validity::ConvertRow<d>(a.values, a.columns, entries_of(a, own.own), a.from + row_at(own, a.from_rows, 0, d), kBatch,
                          a.to + row_at(own, a.rows, own.own, d));
}

/// A scaled coefficient of a derivative. Its pair of columns and its pair of values belong to the row.
template <int d>
HWY_INLINE void differentiate_row(const device::RowArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.rows);
  if (own.batch >= a.batches) return;
  const double plus_weight = a.values[2 * own.own], minus_weight = a.values[2 * own.own + 1];
  const double* plus = a.from + row_at(own, a.from_rows, a.columns[2 * own.own], d);
  const double* minus = a.from + row_at(own, a.from_rows, a.columns[2 * own.own + 1], d);
  double* to = a.to + row_at(own, a.rows, own.own, d);
  VARIMESH_UNROLLED for (int c = 0; c < d; ++c) {
    to[c * kBatch] = validity::DifferenceOf(plus_weight, plus + c * kBatch, minus_weight, minus + c * kBatch).value;
  }
}

/// A scaled coefficient of the cross product of two derivatives, in space.
HWY_INLINE void cross_row(const device::RowArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.rows);
  if (own.batch >= a.batches) return;
  validity::CrossRow(a.columns, entries_of(a, own.own), a.from + row_at(own, a.from_rows, 0, 3),
                     a.other + row_at(own, a.other_rows, 0, 3), kBatch, a.to + row_at(own, a.rows, own.own, 3));
}

/// A coefficient of J.
template <int d>
HWY_INLINE void coefficient_row(const device::RowArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.rows);
  if (own.batch >= a.batches) return;
  const double scaled =
      validity::Coefficient<d>(a.columns, entries_of(a, own.own), a.from + row_at(own, a.from_rows, 0, d),
                               a.other + row_at(own, a.other_rows, 0, d), kBatch)
          .value;
  a.to[row_at(own, a.rows, own.own, 1)] = scaled * a.factors[own.own];
}

/// As the processor's vectors have them: if a number is NaN, the result is b.
HWY_INLINE double larger(double a, double b) { return a > b ? a : b; }
HWY_INLINE double smaller(double a, double b) { return a < b ? a : b; }

/// All that measures a cell.
template <int d>
HWY_INLINE void measure_cell(const device::MeasureArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, 1);
  if (own.batch >= a.batches) return;
  double* to = a.to + row_at(own, d * d + d + 3 + a.corners, 0, 1);
  VARIMESH_UNROLLED for (int r = 0; r < d; ++r) {
    double most[d] = {};
    const double* g = a.derivative[r] + row_at(own, a.of_derivative[r], 0, d);
    for (int i = 0; i < a.of_derivative[r]; ++i, g += d * kBatch) {
      const double reciprocal = a.reciprocal[r][i];
      VARIMESH_UNROLLED for (int c = 0; c < d; ++c) {
        most[c] = larger(most[c], __builtin_fabs(g[c * kBatch]) * reciprocal);
      }
    }
    VARIMESH_UNROLLED for (int c = 0; c < d; ++c) { to[(r * d + c) * kBatch] = most[c]; }
  }
  to += d * d * kBatch;
  double extent[d] = {}, probe = 0;
  const double* x = a.relative + row_at(own, a.nodes, 0, d);
  for (int n = 0; n < a.nodes; ++n, x += d * kBatch) {
    VARIMESH_UNROLLED for (int c = 0; c < d; ++c) {
      extent[c] = larger(extent[c], __builtin_fabs(x[c * kBatch]));
      probe = __builtin_fma(x[c * kBatch], 0.0, probe);
    }
  }
  VARIMESH_UNROLLED for (int c = 0; c < d; ++c) { to[c * kBatch] = extent[c]; }
  to[d * kBatch] = probe;
  to += (d + 1) * kBatch;
  const double* jacobian = a.jacobian + row_at(own, a.coefficients, 0, 1);
  double least = 1.7976931348623157e308, greatest = -least;
  for (int k = 0; k < a.coefficients; ++k) {
    least = smaller(least, jacobian[k * kBatch]);
    greatest = larger(greatest, jacobian[k * kBatch]);
  }
  to[0] = least;
  to[kBatch] = greatest;
  for (int k = 0; k < a.corners; ++k) to[(2 + k) * kBatch] = jacobian[a.corner[k] * kBatch];
}

// ===== Samples =====

template <int d>
struct NodesOfCell {
  const double* x;
  HWY_INLINE lattice::V operator()(int n, int c) const { return {x[(n * d + c) * kBatch]}; }
};
struct TakeUp {
  const double* from;
  HWY_INLINE void operator()(int number, lattice::V& value) const { value = {from[number * kBatch]}; }
};
struct Keep {
  double* to;
  HWY_INLINE void operator()(int number, const lattice::V& value) const { to[number * kBatch] = value.value; }
};

/// The points of a range in one cell.
template <int d>
HWY_INLINE void sample_cell(const device::SampleArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, 1);
  if (own.batch >= a.batches) return;
  double* kept = a.progress + row_at(own, lattice::Progress::kNumbers, 0, 1);
  lattice::Progress progress({0});
  if (a.first > 0) progress.visit(TakeUp{kept});
  lattice::SamplePoints<d>({a.first, a.count, a.gradients, a.straight, a.nodes, a.vertices},
                           NodesOfCell<d>{a.relative + row_at(own, a.nodes, 0, d)}, progress);
  progress.visit(Keep{kept});
}

}  // namespace judge
}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
