// The lattice kernel, compiled for every vector unit that Highway knows on this architecture. Each lane is a cell.
#include "core/quality/lattice_kernel.h"

#include <algorithm>

#include "core/reference/basis.h"
#include "core/reference/cache.h"

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

/// LatticeProgress in vectors.
struct Progress {
  V sum;
  Range jacobian, straight, distortion;

  explicit Progress(V first) : sum(first), jacobian(first), straight(first), distortion(first) {}
  explicit Progress(const LatticeProgress& from) : Progress(hn::LoadU(D(), from.lanes[0].data())) {
    V* const to[] = {&jacobian.low, &jacobian.high, &jacobian.low_at, &jacobian.high_at,
                     &straight.low, &straight.high, &distortion.low,  &distortion.high};
    for (std::size_t i = 0; i < 8; ++i) *to[i] = hn::LoadU(D(), from.lanes[i + 1].data());
  }
  void keep(LatticeProgress& out) const {
    const V from[] = {sum,          jacobian.low,  jacobian.high,  jacobian.low_at, jacobian.high_at,
                      straight.low, straight.high, distortion.low, distortion.high};
    for (std::size_t i = 0; i < 9; ++i) hn::StoreU(from[i], D(), out.lanes[i].data());
  }
};

template <int kDim>
void Sample(const LatticeTable& table, const LatticeRows& rows, const double* HWY_RESTRICT x, LatticeProgress& out) {
  const int nodes = table.nodes(), vertices = table.vertices();
  const std::size_t row = static_cast<std::size_t>(nodes) * kDim;
  const std::size_t straight_row = static_cast<std::size_t>(vertices) * kDim;
  Progress progress = rows.first == 0 ? Progress(Determinant<kDim>(rows.gradients.data(), nodes, x)) : Progress(out);
  for (std::size_t i = 0; i < rows.count; ++i) {
    const std::size_t p = rows.first + i;
    const V J = p == 0 ? progress.sum : Determinant<kDim>(rows.gradients.data() + i * row, nodes, x);
    if (p > 0) {
      progress.sum = progress.sum + J;
      progress.jacobian.add(J, static_cast<double>(p));
    }
    if (vertices == 0) continue;
    const V J_straight = Determinant<kDim>(rows.straight.data() + i * straight_row, vertices, x);
    const V quotient = J / J_straight;
    if (p == 0) {
      progress.straight = Range(J_straight);
      progress.distortion = Range(quotient);
    }
    progress.straight.add(J_straight, 0);
    progress.distortion.add(quotient, 0);
  }
  progress.keep(out);
}

void Kernel(const LatticeTable& table, const LatticeRows& rows, const double* x, LatticeProgress& progress) {
  if (table.dimension() == 2)
    Sample<2>(table, rows, x, progress);
  else
    Sample<3>(table, rows, x, progress);
}

}  // namespace varimesh::detail::lattice::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {
namespace lattice {
HWY_EXPORT(Kernel);
HWY_EXPORT(Lanes);
std::size_t lanes() { return HWY_DYNAMIC_DISPATCH(Lanes)(); }
void sample(const LatticeTable& table, const LatticeRows& rows, const double* x, LatticeProgress& progress) {
  HWY_DYNAMIC_DISPATCH(Kernel)(table, rows, x, progress);
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

// === LatticeTable ========================================================================================

LatticeTable::LatticeTable(Shape shape, int order, int intervals, int dimension)
    : dimension_(dimension),
      nodes_(reference::node_count(shape, order)),
      vertices_(reference::info(shape).affine ? 0 : reference::node_count(shape, 1)),
      basis_(shape, order, reference::NodeSet::Equispaced, dimension, reference::uniform_lattice(shape, intervals)),
      linear_(shape, 1, reference::NodeSet::Equispaced, dimension, basis_.points()) {
  const std::size_t row_bytes = sizeof(double) * at(nodes_) * at(dimension);
  per_range_ = std::min(at(points().rows()), std::max<std::size_t>(1, at(kMostLatticeBytes) / row_bytes));
  if (ranges() == 1) kept_ = make_rows(0);
}

LatticeRows LatticeTable::make_rows(std::size_t range) const {
  LatticeRows rows;
  rows.first = range * per_range_;
  rows.count = std::min(per_range_, at(points().rows()) - rows.first);
  const auto first = static_cast<Eigen::Index>(rows.first), count = static_cast<Eigen::Index>(rows.count);
  rows.gradients = interleaved(basis_.gradients(first, count));
  if (vertices_ > 0) rows.straight = interleaved(linear_.gradients(first, count));
  return rows;
}

const LatticeRows& LatticeTable::rows(std::size_t range, LatticeRows& workspace) const {
  if (kept_.count > 0) return kept_;
  workspace = make_rows(range);
  return workspace;
}

const LatticeTable& lattice_table(Shape shape, int order, int intervals, int dimension) {
  static reference::Cache<std::array<int, 4>, LatticeTable> cache;
  return cache.get({static_cast<int>(shape), order, intervals, dimension},
                   [&] { return LatticeTable(shape, order, intervals, dimension); });
}

// === Samples =============================================================================================

std::size_t lattice_lanes() { return lattice::lanes(); }

void sample_rows(const LatticeTable& table, const LatticeRows& rows, const LatticeBatch& batch,
                 std::vector<double>& workspace, LatticeProgress& progress) {
  const std::size_t lanes = lattice_lanes();
  const auto d = static_cast<std::size_t>(table.dimension());
  workspace.resize(at(table.nodes()) * d * lanes);
  // Coordinates are relative to each cell's first node, so a mesh far from the origin keeps its digits. Lanes without a
  // cell repeat the last one.
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::int32_t* list = batch.nodes[std::min(lane, batch.cells - 1)];
    const double* origin = batch.coordinates + 3 * static_cast<std::size_t>(list[0]);
    double* to = workspace.data() + lane;
    for (int n = 0; n < table.nodes(); ++n)
      for (std::size_t c = 0; c < d; ++c, to += lanes)
        *to = batch.coordinates[3 * static_cast<std::size_t>(list[n]) + c] - origin[c];
  }
  lattice::sample(table, rows, workspace.data(), progress);
}

void finish_samples(const LatticeTable& table, const LatticeProgress& progress, std::size_t cells, Extremes* out) {
  const auto points = static_cast<double>(table.points().rows());
  const auto& [sum, low, high, low_at, high_at, straight_low, straight_high, distortion_low, distortion_high] =
      progress.lanes;
  for (std::size_t i = 0; i < cells; ++i) {
    out[i].low = low[i];
    out[i].high = high[i];
    out[i].low_at = static_cast<std::int32_t>(low_at[i]);
    out[i].high_at = static_cast<std::int32_t>(high_at[i]);
    out[i].mean = sum[i] / points;
    if (table.vertices() == 0) continue;
    // If the straight-sided form of a cell is itself inverted, there is no deformation gradient. It counts as nowhere
    // positive.
    const bool inverted = straight_low[i] <= 0 && straight_high[i] >= 0;
    out[i].distortion_low = inverted ? -1 : distortion_low[i];
    out[i].distortion_high = inverted ? -1 : distortion_high[i];
  }
}

}  // namespace varimesh::detail
#endif  // HWY_ONCE
