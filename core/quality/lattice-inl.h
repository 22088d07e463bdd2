// det ∇χ_M at points of a lattice, and what its values in a cell show. Internal to the library; for vectors of cells on
// the processor and for one cell per thread on a device. Each product is fused as it is written, so both have the same
// bits where the processor fuses too.
#if defined(VARIMESH_QUALITY_LATTICE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_QUALITY_LATTICE_INL_H
#undef VARIMESH_QUALITY_LATTICE_INL_H
#else
#define VARIMESH_QUALITY_LATTICE_INL_H
#endif

#include <hwy/highway.h>

#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::lattice::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, 32>;  // kMostLatticeLanes
using V = hn::Vec<D>;

/// a b − c d
HWY_INLINE V CrossTerm(V a, V b, V c, V d) { return hn::NegMulAdd(c, d, a * b); }

/// det ∇χ at one point: `gradients` is [node][direction]. x(n, c) is component c of node n.
template <int kDim, class X>
HWY_INLINE V Determinant(const double* gradients, int nodes, const X& x) {
  const D d;
  V x0, x1, x2, g;
  V r0 = hn::Zero(d), r1 = r0, r2 = r0, s0 = r0, s1 = r0, s2 = r0, t0 = r0, t1 = r0, t2 = r0;
  for (int n = 0; n < nodes; ++n, gradients += kDim) {
    x0 = x(n, 0);
    x1 = x(n, 1);
    g = hn::Set(d, gradients[0]);
    r0 = hn::MulAdd(g, x0, r0);
    r1 = hn::MulAdd(g, x1, r1);
    g = hn::Set(d, gradients[1]);
    s0 = hn::MulAdd(g, x0, s0);
    s1 = hn::MulAdd(g, x1, s1);
    if constexpr (kDim == 3) {
      x2 = x(n, 2);
      s2 = hn::MulAdd(g, x2, s2);
      r2 = hn::MulAdd(hn::Set(d, gradients[0]), x2, r2);
      g = hn::Set(d, gradients[2]);
      t0 = hn::MulAdd(g, x0, t0);
      t1 = hn::MulAdd(g, x1, t1);
      t2 = hn::MulAdd(g, x2, t2);
    }
  }
  if constexpr (kDim == 2) return CrossTerm(r0, s1, r1, s0);
  const V first = CrossTerm(s1, t2, s2, t1), second = CrossTerm(s0, t2, s2, t0), third = CrossTerm(s0, t1, s1, t0);
  return hn::MulAdd(r2, third, CrossTerm(r0, first, r1, second));
}

/// The smallest and the largest value of a sequence, and where they first occur.
struct Range {
  V low, high, low_at, high_at;

  HWY_INLINE explicit Range(V first) : low(first), high(first), low_at(hn::Zero(D())), high_at(hn::Zero(D())) {}
  HWY_INLINE void add(V value, double at) {
    const auto lower = hn::Lt(value, low), higher = hn::Lt(high, value);
    low = hn::IfThenElse(lower, value, low);
    high = hn::IfThenElse(higher, value, high);
    low_at = hn::IfThenElse(lower, hn::Set(D(), at), low_at);
    high_at = hn::IfThenElse(higher, hn::Set(D(), at), high_at);
  }
};

/// What the points that were sampled so far have shown.
struct Progress {
  V sum;
  Range jacobian, straight, distortion;

  HWY_INLINE explicit Progress(V first) : sum(first), jacobian(first), straight(first), distortion(first) {}

  /// What is kept between two ranges of points.
  static constexpr int kNumbers = 9;
  /// Calls visit(number, value) for each number that is kept.
  template <class Visit>
  HWY_INLINE void visit(const Visit& visit) {
    visit(0, sum);
    visit(1, jacobian.low);
    visit(2, jacobian.high);
    visit(3, jacobian.low_at);
    visit(4, jacobian.high_at);
    visit(5, straight.low);
    visit(6, straight.high);
    visit(7, distortion.low);
    visit(8, distortion.high);
  }
};

/// The rows of a range of points (LatticeRows), and the cell's nodes and vertices (LatticeTable).
struct PointRows {
  std::int64_t first = 0, count = 0;
  const double* gradients = nullptr;
  const double* straight = nullptr;
  int nodes = 0, vertices = 0;
};

/// Samples a range of points. `progress` is that of the ranges before; if this is the first one, it is begun.
template <int kDim, class X>
HWY_INLINE void SamplePoints(const PointRows& rows, const X& x, Progress& progress) {
  const std::int64_t row = std::int64_t{rows.nodes} * kDim, straight_row = std::int64_t{rows.vertices} * kDim;
  if (rows.first == 0) progress = Progress(Determinant<kDim>(rows.gradients, rows.nodes, x));
  for (std::int64_t i = 0; i < rows.count; ++i) {
    const std::int64_t p = rows.first + i;
    const V J = p == 0 ? progress.sum : Determinant<kDim>(rows.gradients + i * row, rows.nodes, x);
    if (p > 0) {
      progress.sum = progress.sum + J;
      progress.jacobian.add(J, static_cast<double>(p));
    }
    if (rows.vertices == 0) continue;
    const V J_straight = Determinant<kDim>(rows.straight + i * straight_row, rows.vertices, x);
    const V quotient = J / J_straight;
    if (p == 0) {
      progress.straight = Range(J_straight);
      progress.distortion = Range(quotient);
    }
    progress.straight.add(J_straight, 0);
    progress.distortion.add(quotient, 0);
  }
}

}  // namespace varimesh::detail::lattice::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
