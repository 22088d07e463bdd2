// The lattice kernel, compiled for every vector unit that Highway knows on this architecture. Each lane is a cell.
#include "core/quality/lattice_kernel.h"

#include <algorithm>

#include "core/reference/basis.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/quality/lattice_kernel.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::lattice::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kMostLatticeLanes>;
using V = hn::Vec<D>;

std::size_t Lanes() { return hn::Lanes(D()); }

/// det ∇χ at one point: `gradients` is [node][direction], `x` [node][component][lane].
template <int kDim>
HWY_INLINE V Determinant(const double* HWY_RESTRICT gradients, int nodes, const double* HWY_RESTRICT x) {
  const D d;
  const std::size_t lanes = Lanes();
  V x0, x1, x2, g;
  V r0 = hn::Zero(d), r1 = r0, r2 = r0, s0 = r0, s1 = r0, s2 = r0, t0 = r0, t1 = r0, t2 = r0;
  for (int n = 0; n < nodes; ++n, x += kDim * lanes, gradients += kDim) {
    x0 = hn::LoadU(d, x);
    x1 = hn::LoadU(d, x + lanes);
    g = hn::Set(d, gradients[0]);
    r0 = hn::MulAdd(g, x0, r0);
    r1 = hn::MulAdd(g, x1, r1);
    g = hn::Set(d, gradients[1]);
    s0 = hn::MulAdd(g, x0, s0);
    s1 = hn::MulAdd(g, x1, s1);
    if constexpr (kDim == 3) {
      x2 = hn::LoadU(d, x + 2 * lanes);
      s2 = hn::MulAdd(g, x2, s2);
      r2 = hn::MulAdd(hn::Set(d, gradients[0]), x2, r2);
      g = hn::Set(d, gradients[2]);
      t0 = hn::MulAdd(g, x0, t0);
      t1 = hn::MulAdd(g, x1, t1);
      t2 = hn::MulAdd(g, x2, t2);
    }
  }
  if constexpr (kDim == 2) return r0 * s1 - r1 * s0;
  return r0 * (s1 * t2 - s2 * t1) - r1 * (s0 * t2 - s2 * t0) + r2 * (s0 * t1 - s1 * t0);
}

/// The smallest and the largest value of a sequence, and where they first occur.
struct Range {
  V low, high, low_at, high_at;

  explicit Range(V first) : low(first), high(first), low_at(hn::Zero(D())), high_at(hn::Zero(D())) {}
  HWY_INLINE void add(V value, double at) {
    const auto lower = hn::Lt(value, low), higher = hn::Gt(value, high);
    low = hn::IfThenElse(lower, value, low);
    high = hn::IfThenElse(higher, value, high);
    low_at = hn::IfThenElse(lower, hn::Set(D(), at), low_at);
    high_at = hn::IfThenElse(higher, hn::Set(D(), at), high_at);
  }
};

void Write(V value, std::size_t cells, Extremes* out, double Extremes::*field) {
  double lanes[kMostLatticeLanes];
  hn::StoreU(value, D(), lanes);
  for (std::size_t i = 0; i < cells; ++i) out[i].*field = lanes[i];
}

void Write(V value, std::size_t cells, Extremes* out, std::int32_t Extremes::*field) {
  double lanes[kMostLatticeLanes];
  hn::StoreU(value, D(), lanes);
  for (std::size_t i = 0; i < cells; ++i) out[i].*field = static_cast<std::int32_t>(lanes[i]);
}

template <int kDim>
void Sample(const LatticeTable& table, const double* HWY_RESTRICT x, std::size_t cells, Extremes* out) {
  const D d;
  const auto points = static_cast<std::size_t>(table.points.rows());
  const std::size_t row = static_cast<std::size_t>(table.nodes) * kDim;
  const std::size_t straight_row = static_cast<std::size_t>(table.vertices) * kDim;
  Range jacobian(Determinant<kDim>(table.gradients.data(), table.nodes, x));
  V sum = jacobian.low;
  Range straight(sum), distortion(sum);
  for (std::size_t p = 0; p < points; ++p) {
    const V J = p == 0 ? sum : Determinant<kDim>(table.gradients.data() + p * row, table.nodes, x);
    if (p > 0) {
      sum = sum + J;
      jacobian.add(J, static_cast<double>(p));
    }
    if (table.vertices == 0) continue;
    const V J_straight = Determinant<kDim>(table.straight.data() + p * straight_row, table.vertices, x);
    const V quotient = J / J_straight;
    if (p == 0) {
      straight = Range(J_straight);
      distortion = Range(quotient);
    }
    straight.add(J_straight, 0);
    distortion.add(quotient, 0);
  }
  Write(jacobian.low, cells, out, &Extremes::low);
  Write(jacobian.high, cells, out, &Extremes::high);
  Write(jacobian.low_at, cells, out, &Extremes::low_at);
  Write(jacobian.high_at, cells, out, &Extremes::high_at);
  Write(sum / hn::Set(d, static_cast<double>(points)), cells, out, &Extremes::mean);
  if (table.vertices == 0) return;
  // If the straight-sided form of a cell is itself inverted, there is no deformation gradient. It counts as nowhere
  // positive.
  const auto inverted = hn::And(hn::Le(straight.low, hn::Zero(d)), hn::Ge(straight.high, hn::Zero(d)));
  const V nowhere = hn::Set(d, -1.0);
  Write(hn::IfThenElse(inverted, nowhere, distortion.low), cells, out, &Extremes::distortion_low);
  Write(hn::IfThenElse(inverted, nowhere, distortion.high), cells, out, &Extremes::distortion_high);
}

void Kernel(const LatticeTable& table, const double* x, std::size_t cells, Extremes* out) {
  if (table.dimension == 2)
    Sample<2>(table, x, cells, out);
  else
    Sample<3>(table, x, cells, out);
}

}  // namespace varimesh::detail::lattice::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {
namespace lattice {
HWY_EXPORT(Kernel);
HWY_EXPORT(Lanes);
std::size_t lanes() { return HWY_DYNAMIC_DISPATCH(Lanes)(); }
void sample(const LatticeTable& table, const double* x, std::size_t cells, Extremes* out) {
  HWY_DYNAMIC_DISPATCH(Kernel)(table, x, cells, out);
}
}  // namespace lattice

namespace {

/// One points × nodes matrix per direction, as [point][node][direction].
std::vector<double> interleaved(const std::vector<Eigen::MatrixXd>& gradients) {
  std::vector<double> out;
  out.reserve(static_cast<std::size_t>(gradients[0].size()) * gradients.size());
  for (Eigen::Index p = 0; p < gradients[0].rows(); ++p)
    for (Eigen::Index n = 0; n < gradients[0].cols(); ++n)
      for (const Eigen::MatrixXd& direction : gradients) out.push_back(direction(p, n));
  return out;
}

}  // namespace

LatticeTable lattice_table(Shape shape, int order, int intervals, int dimension) {
  using reference::NodeSet;
  LatticeTable table;
  table.dimension = dimension;
  table.nodes = reference::node_count(shape, order);
  table.points = reference::uniform_lattice(shape, intervals);
  table.gradients = interleaved(reference::basis_gradients(shape, order, NodeSet::Equispaced, dimension, table.points));
  if (reference::info(shape).affine) return table;
  table.vertices = reference::node_count(shape, 1);
  table.straight = interleaved(reference::basis_gradients(shape, 1, NodeSet::Equispaced, dimension, table.points));
  return table;
}

std::size_t lattice_lanes() { return lattice::lanes(); }

void sample_on_lattice(const LatticeTable& table, const double* coordinates, const std::int32_t* const* nodes,
                       std::size_t cells, std::vector<double>& workspace, Extremes* out) {
  const std::size_t lanes = lattice_lanes();
  const auto d = static_cast<std::size_t>(table.dimension);
  workspace.resize(static_cast<std::size_t>(table.nodes) * d * lanes);
  // Coordinates are relative to each cell's first node, so a mesh far from the origin keeps its digits. Lanes without a
  // cell repeat the last one.
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::int32_t* list = nodes[std::min(lane, cells - 1)];
    const double* origin = coordinates + 3 * static_cast<std::size_t>(list[0]);
    double* to = workspace.data() + lane;
    for (int n = 0; n < table.nodes; ++n)
      for (std::size_t c = 0; c < d; ++c, to += lanes)
        *to = coordinates[3 * static_cast<std::size_t>(list[n]) + c] - origin[c];
  }
  lattice::sample(table, workspace.data(), cells, out);
}

}  // namespace varimesh::detail
#endif  // HWY_ONCE
