// Maps of all orders on the cells of a mesh, and the loss of accuracy as a form of them (core/solvers/descent/form).
// Each function is one thread. Threads of a set of cells are numbered row by row, the lane innermost.
#if defined(VARIMESH_DEVICE_DESCENT_FORM_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_DEVICE_DESCENT_FORM_INL_H
#undef VARIMESH_DEVICE_DESCENT_FORM_INL_H
#else
#define VARIMESH_DEVICE_DESCENT_FORM_INL_H
#endif

#include "core/base/index.h"
#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/device_kernels/kernels/unrolled.h"
#include "core/energy/number-inl.h"
#include "core/kernels/hessian/batch.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {
namespace descent {

/// The numbers of a thread.
struct RowOfCell {
  std::int64_t batch;
  int own, lane;

  /// @param rows  per cell
  static HWY_INLINE RowOfCell of(std::int64_t thread, int rows) {
    const std::int64_t number = thread / kBatch;
    return {number / rows, static_cast<int>(number % rows), static_cast<int>(thread % kBatch)};
  }
  /// Where the values of a place of the cell begin; those of the next direction are kBatch away.
  /// @param places  of a cell
  template <int d>
  HWY_INLINE std::int64_t value(int places, int place) const {
    return (batch * places + place) * (d * kBatch) + lane;
  }
};

/// The value of a vector at a place of a cell.
template <int d>
HWY_INLINE void gather_values(const device::GatherArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.places);
  if (own.batch >= a.batches) return;
  const std::int32_t said = a.numbers[thread];
  const std::int64_t number = said >= 0 || a.only_first != 0 ? said : device::later_place(said);
  double* to = a.to + own.value<d>(a.places, own.own);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { to[k * kBatch] = number < 0 ? 0.0 : a.vector[number * d + k]; }
}

/// The position of a node of a cell relative to the cell's first node.
template <int d>
HWY_INLINE void gather_shape(const device::ShapeArguments& a, std::int64_t thread) {
  const RowOfCell own = RowOfCell::of(thread, a.places);
  if (own.batch >= a.batches) return;
  const std::int32_t* nodes = a.cell_nodes + own.batch * a.places * kBatch + own.lane;
  const int local = a.locals == nullptr ? own.own : a.locals[own.own];
  const double* x = a.positions + static_cast<std::int64_t>(nodes[local * kBatch]) * d;
  const double* first = a.positions + static_cast<std::int64_t>(nodes[0]) * d;
  double* to = a.to + own.value<d>(a.places, own.own);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { to[k * kBatch] = x[k] - first[k]; }
}

/// kRowsOfThread rows of a matrix times the values of a cell: each value that is loaded counts in all of them.
template <int d>
HWY_INLINE void multiply_cells(const device::CellMatrixArguments& a, std::int64_t thread) {
  constexpr int kRows = device::kRowsOfThread, kPlace = d * kBatch;
  const int groups = (a.rows + kRows - 1) / kRows;
  const RowOfCell own = RowOfCell::of(thread, groups * a.outer * a.inner);
  if (own.batch >= a.batches) return;
  const int inner = own.own % a.inner, group = own.own / a.inner % groups, outer = own.own / a.inner / groups;
  const int first = group * kRows, last = a.rows - 1 - first;  // rows past the last one repeat it
  const double* matrix = a.matrix + static_cast<std::int64_t>(first) * a.columns;
  const double* from = a.from + ((own.batch * a.outer + outer) * a.columns * a.inner + inner) * kPlace + own.lane;
  double sum[kRows][d] = {};
  for (int c = 0; c < a.columns; ++c, from += static_cast<std::int64_t>(a.inner) * kPlace) {
    double x[d];
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { x[k] = from[k * kBatch]; }
    VARIMESH_UNROLLED for (int r = 0; r < kRows; ++r) {
      const double entry = matrix[(r < last ? r : last) * a.columns + c];
      VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[r][k] = __builtin_fma(entry, x[k], sum[r][k]); }
    }
  }
  VARIMESH_UNROLLED for (int r = 0; r < kRows; ++r) {
    if (r > last) continue;
    const std::int64_t place = ((own.batch * a.outer + outer) * a.rows + first + r) * a.inner + inner;
    double* to = a.to + place * kPlace + (a.by_lane != 0 ? own.lane * d : own.lane);
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { to[a.by_lane != 0 ? k : k * kBatch] = sum[r][k]; }
  }
}

/// Half the slope of a cell's q by a mode. Returns the mode's part of q.
template <int d>
HWY_INLINE double slope_by_mode(const device::SlopesArguments& a, std::int64_t thread) {
  constexpr int kPairs = triangle_size(d);
  const RowOfCell own = RowOfCell::of(thread, a.places);
  if (own.batch >= a.batches) return 0;
  const int mode = a.modes == nullptr ? own.own : a.modes[own.own];
  const double* of_cell = a.from + own.value<d>(a.places, 0);
  const std::int64_t at = own.value<d>(a.places, own.own);
  if (mode < 0) {
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.to[at + k * kBatch] = 0; }
    return 0;
  }
  double metric[kPairs], sum[d] = {};
  VARIMESH_UNROLLED for (int pair = 0; pair < kPairs; ++pair) {
    metric[pair] = a.metrics[(own.batch * kPairs + pair) * kBatch + own.lane];
  }
  for (int i = a.first[mode]; i < a.first[mode + 1]; ++i) {
    const double* entry = a.entries + static_cast<std::int64_t>(i) * kPairs;
    double weight = entry[0] * metric[0];
    VARIMESH_UNROLLED for (int pair = 1; pair < kPairs; ++pair) {
      weight = __builtin_fma(entry[pair], metric[pair], weight);
    }
    const double* x = of_cell + a.columns[i] * (d * kBatch);
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = __builtin_fma(weight, x[k * kBatch], sum[k]); }
  }
  const double of_degree = a.weights[mode];
  double value = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    sum[k] = of_degree * sum[k];
    value = __builtin_fma(sum[k], a.from[at + k * kBatch], value);
    a.to[at + k * kBatch] = a.factor * sum[k];
  }
  return value;
}

/// The sum of the contributions at the places of a node, in their order.
template <int d>
HWY_INLINE void sum_of_places(const device::OrderArguments& a, std::int64_t node, double (&sum)[d]) {
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = 0; }
  for (std::int64_t i = a.begin[node]; i < a.begin[node + 1]; ++i) {
    const double* from = a.contributions + a.places[i] * d;
    VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { sum[k] = sum[k] + from[k]; }
  }
}

/// The residual of a level: the sum of what cells have restricted.
template <int d>
HWY_INLINE void add_up_residual(const device::OrderArguments& a, std::int64_t node) {
  if (node >= a.nodes) return;
  double sum[d];
  sum_of_places<d>(a, node, sum);
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) { a.residual[node * d + k] = sum[k]; }
}

/// The solution of a level: that of the level below, which all cells of a node give the same value, and its own.
/// Returns the node's part of residual · solution.
template <int d>
HWY_INLINE double correct(const device::OrderArguments& a, std::int64_t node) {
  if (node >= a.nodes) return 0;
  double along = 0;
  VARIMESH_UNROLLED for (int k = 0; k < d; ++k) {
    const double below = a.contributions == nullptr ? 0.0 : a.contributions[a.places[a.begin[node]] * d + k];
    const double r = a.residual[node * d + k], z = __builtin_fma(a.inverse[node], r, below);
    a.solution[node * d + k] = z;
    along = __builtin_fma(r, z, along);
  }
  return along;
}

}  // namespace descent
}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
