#include "core/mesh/changes/straight_sides.h"

#include <Eigen/Core>
#include <atomic>
#include <cmath>

#include "core/mesh/bounding_box.h"
#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 1024;
constexpr double kRounding = 1e-9;

/// Whether no node of the cell is further than `most` from its place in the straight-sided cell.
/// @param values of the straight-sided cell's basis at all nodes: nodes × vertices
bool is_straight(const HighOrderMesh& mesh, const std::int32_t* nodes, const Eigen::MatrixXd& values, double most) {
  Eigen::MatrixX3d x(values.rows(), 3);
  for (Eigen::Index n = 0; n < values.rows(); ++n)
    x.row(n) = Eigen::Map<const Eigen::RowVector3d>(mesh.coordinates.data() + 3 * static_cast<std::size_t>(nodes[n]));
  return (values * x.topRows(values.cols()) - x).cwiseAbs().maxCoeff() <= most;
}

}  // namespace

bool has_straight_sides(const HighOrderMesh& mesh, const Team& team) {
  const BoundingBox box = bounding_box(mesh, team);
  const double diagonal = std::hypot(box.high[0] - box.low[0], box.high[1] - box.low[1], box.high[2] - box.low[2]);
  std::atomic<bool> straight{true};
  const Cells cells(mesh, mesh.dimension);
  for (const Cells::Range& range : cells.ranges()) {
    const ElementBlock& block = *range.block;
    const reference::Points& places =
        reference::nodes(block.shape, block.order, reference::NodeSet::Equispaced, mesh.dimension);
    const Eigen::MatrixXd values =
        reference::basis_values(block.shape, 1, reference::NodeSet::Equispaced, mesh.dimension, places);
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end && straight.load(std::memory_order_relaxed); ++e)
        if (!is_straight(mesh, block.nodes.data() + e * range.stride, values, kRounding * diagonal))
          straight.store(false, std::memory_order_relaxed);
    });
  }
  return straight;
}

}  // namespace varimesh
