// The lattice kernel, compiled for every vector unit that Highway knows on this architecture. Each lane is a cell.
#include "core/quality/lattice_kernel.h"

#include <algorithm>
#include <tuple>

#include "core/reference/basis.h"
#include "core/reference/cache.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/quality/lattice_kernel.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "core/quality/lattice-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::lattice::HWY_NAMESPACE {

static_assert(Progress::kNumbers == std::tuple_size_v<decltype(LatticeProgress::lanes)>);

std::size_t Lanes() { return hn::Lanes(D()); }

/// The nodes of the cells, [node][component][lane].
template <int kDim>
struct Nodes {
  const double* HWY_RESTRICT x;
  HWY_INLINE V operator()(int n, int c) const {
    return hn::LoadU(D(), x + static_cast<std::size_t>(n * kDim + c) * hn::Lanes(D()));
  }
};
struct TakeUp {
  const LatticeProgress& from;
  HWY_INLINE void operator()(int number, V& value) const {
    value = hn::LoadU(D(), from.lanes[static_cast<std::size_t>(number)].data());
  }
};
struct Keep {
  LatticeProgress& to;
  HWY_INLINE void operator()(int number, const V& value) const {
    hn::StoreU(value, D(), to.lanes[static_cast<std::size_t>(number)].data());
  }
};

template <int kDim>
void Sample(const LatticeTable& table, const LatticeRows& rows, const double* x, LatticeProgress& out) {
  Progress progress(hn::Zero(D()));
  progress.visit(TakeUp{out});
  SamplePoints<kDim>({static_cast<std::int64_t>(rows.first), static_cast<std::int64_t>(rows.count),
                      rows.gradients.data(), rows.straight.data(), table.nodes(), table.vertices()},
                     Nodes<kDim>{x}, progress);
  progress.visit(Keep{out});
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
