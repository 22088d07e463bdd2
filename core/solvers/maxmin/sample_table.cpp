// The kernels are compiled for every vector unit that Highway knows on this architecture. Each lane is a point. Sums
// run over nodes or points in ascending order.
#include "core/solvers/maxmin/sample_table.h"

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/base/index.h"
#include "core/reference/basis.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/solvers/maxmin/sample_table.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace varimesh::samples::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
constexpr std::size_t kTile = SampleTable::kTile;
using Tag = hn::CappedTag<double, kTile>;
using V = hn::Vec<Tag>;

/// SampleTable::differentiate(). `out` has `padded` numbers for each pair of directions.
template <std::size_t D>
void DifferentiateIn(const double* HWY_RESTRICT gradients, std::size_t tiles, std::size_t nodes,
                     const double* HWY_RESTRICT x, double* HWY_RESTRICT out) {
  const Tag tag;
  const std::size_t padded = tiles * kTile;
  for (std::size_t tile = 0; tile < tiles; ++tile, gradients += nodes * D * kTile)
    for (std::size_t lane = 0; lane < kTile; lane += hn::Lanes(tag)) {
      V sum[D][D];
      for (std::size_t k = 0; k < D; ++k)
        for (std::size_t c = 0; c < D; ++c) sum[k][c] = hn::Zero(tag);
      const double* HWY_RESTRICT at = gradients + lane;
      const double* HWY_RESTRICT value = x;
      for (std::size_t n = 0; n < nodes; ++n, at += D * kTile, value += D)
        for (std::size_t k = 0; k < D; ++k) {
          const V gradient = hn::LoadU(tag, at + k * kTile);
          for (std::size_t c = 0; c < D; ++c) sum[k][c] = hn::MulAdd(gradient, hn::Set(tag, value[c]), sum[k][c]);
        }
      for (std::size_t k = 0; k < D; ++k)
        for (std::size_t c = 0; c < D; ++c)
          hn::StoreU(sum[k][c], tag, out + (k * D + c) * padded + tile * kTile + lane);
    }
}

/// SampleTable::add_up(): `lanes`, kTile numbers for each node and component, have the sums by place in a tile.
template <std::size_t D>
void AddUpIn(const double* HWY_RESTRICT gradients, std::size_t tiles, std::size_t nodes,
             const double* HWY_RESTRICT weights, double* HWY_RESTRICT lanes) {
  const Tag tag;
  const std::size_t padded = tiles * kTile;
  for (std::size_t tile = 0; tile < tiles; ++tile, gradients += nodes * D * kTile)
    for (std::size_t lane = 0; lane < kTile; lane += hn::Lanes(tag)) {
      V weight[D][D];
      for (std::size_t k = 0; k < D; ++k)
        for (std::size_t c = 0; c < D; ++c)
          weight[k][c] = hn::LoadU(tag, weights + (k * D + c) * padded + tile * kTile + lane);
      for (std::size_t n = 0; n < nodes; ++n) {
        const double* HWY_RESTRICT at = gradients + n * D * kTile + lane;
        double* HWY_RESTRICT to = lanes + n * D * kTile + lane;
        V sum[D];
        for (std::size_t c = 0; c < D; ++c) sum[c] = hn::LoadU(tag, to + c * kTile);
        for (std::size_t k = 0; k < D; ++k) {
          const V gradient = hn::LoadU(tag, at + k * kTile);
          for (std::size_t c = 0; c < D; ++c) sum[c] = hn::MulAdd(gradient, weight[k][c], sum[c]);
        }
        for (std::size_t c = 0; c < D; ++c) hn::StoreU(sum[c], tag, to + c * kTile);
      }
    }
}

void Differentiate(std::size_t d, const double* gradients, std::size_t tiles, std::size_t nodes, const double* x,
                   double* out) {
  if (d == 2)
    DifferentiateIn<2>(gradients, tiles, nodes, x, out);
  else
    DifferentiateIn<3>(gradients, tiles, nodes, x, out);
}

void AddUp(std::size_t d, const double* gradients, std::size_t tiles, std::size_t nodes, const double* weights,
           double* lanes) {
  if (d == 2)
    AddUpIn<2>(gradients, tiles, nodes, weights, lanes);
  else
    AddUpIn<3>(gradients, tiles, nodes, weights, lanes);
}

}  // namespace varimesh::samples::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh {
namespace samples {
HWY_EXPORT(Differentiate);
HWY_EXPORT(AddUp);
}  // namespace samples

namespace {

/// Larger tables than this many numbers per direction are not made.
constexpr std::int64_t kMostInTable = 2'000'000;
/// The same for tables whose spacing was halved twice: 12 MB, about what the estimate of memory has to spare.
/// Tetrahedra up to order 4 have them.
constexpr std::int64_t kMostInClosestTable = 500'000;

}  // namespace

const SampleTable* SampleTables::table(Shape shape, int halvings) {
  const auto found = tables_.find({shape, halvings});
  if (found != tables_.end()) return found->second ? &*found->second : nullptr;
  std::optional<SampleTable>& made = tables_[{shape, halvings}];
  const reference::Points points = reference::uniform_lattice(shape, (1 << halvings) * (2 * order_ + 2));
  const std::int64_t most = halvings < kMostHalvings ? kMostInTable : kMostInClosestTable;
  if (points.rows() * reference::node_count(shape, order_) > most) return nullptr;
  made.emplace(shape, order_, dimension_, points);
  return &*made;
}

SampleTable::SampleTable(Shape shape, int order, int dimension, const reference::Points& points)
    : dimension_(at(dimension)), nodes_(at(reference::node_count(shape, order))), points_(at(points.rows())) {
  gradients_.resize(tiles() * nodes_ * dimension_ * kTile);
  const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, dimension, points);
  double* to = gradients_.data();
  for (std::size_t tile = 0; tile < tiles(); ++tile)
    for (std::size_t n = 0; n < nodes_; ++n)
      for (std::size_t k = 0; k < dimension_; ++k)
        for (std::size_t point = tile * kTile; point < (tile + 1) * kTile; ++point)
          *to++ = point < points_ ? gradients[k](static_cast<Eigen::Index>(point), static_cast<Eigen::Index>(n)) : 0;
}

void SampleTable::differentiate(const double* x, double* out) const {
  HWY_DYNAMIC_DISPATCH(samples::Differentiate)(dimension_, gradients_.data(), tiles(), nodes_, x, out);
}

void SampleTable::add_up(const double* weights, double* out) const {
  thread_local std::vector<double> lanes;
  lanes.assign(nodes_ * dimension_ * kTile, 0.0);
  HWY_DYNAMIC_DISPATCH(samples::AddUp)(dimension_, gradients_.data(), tiles(), nodes_, weights, lanes.data());
  for (std::size_t entry = 0; entry < nodes_ * dimension_; ++entry) {
    double sum = 0;
    for (std::size_t lane = 0; lane < kTile; ++lane) sum += lanes[entry * kTile + lane];
    out[entry] = sum;
  }
}

}  // namespace varimesh
#endif
