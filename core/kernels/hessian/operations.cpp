#include "core/kernels/hessian/operations.h"

#include "core/base/index.h"

namespace varimesh {
namespace {

/// Additions that turn the members of all orbits into components, or back.
double additions(const std::vector<FoldedGradient::Orbit>& orbits) {
  double sum = 0;
  for (const FoldedGradient::Orbit& orbit : orbits) sum += orbit.mirrors * (1 << orbit.mirrors);
  return sum;
}

}  // namespace

double gradient_operations(const CellSet& cells, const PointOperations& point) {
  const int d = cells.dimension;
  return static_cast<double>(cells.points) * (point.stress + 2 * d * d * cells.nodes_per_cell);
}

double block_operations(const CellSet& cells, const PointOperations& point) {
  const int sides = triangle_size(cells.dimension);
  return static_cast<double>(cells.points) * (point.block + 2 * sides * sides * cells.nodes_per_cell);
}

double product_operations(const BatchSet& set, const PointOperations& point) {
  const int d = set.cells->dimension;
  double sum = static_cast<double>(set.cells->points) * point.product;
  for (const FoldedGradient::Parity& parity : set.gradient.parities)
    sum += 4.0 * d * static_cast<double>(parity.backward.size());
  return sum + 2 * d * additions(set.gradient.node_orbits) + 2 * d * d * additions(set.gradient.point_orbits);
}

MeshOperations mesh_operations(const std::vector<BatchSet>& batches, const PointOperations& point) {
  MeshOperations sum;
  for (const BatchSet& set : batches) {
    const double cells = set.cells->count;
    sum.scan += cells * scan_operations(*set.cells, point);
    sum.gradient += cells * gradient_operations(*set.cells, point);
    sum.blocks += cells * block_operations(*set.cells, point);
    sum.product += cells * product_operations(set, point);
  }
  return sum;
}

}  // namespace varimesh
