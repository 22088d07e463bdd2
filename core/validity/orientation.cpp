// The sign that most straight-sided cells have.
#include "core/validity/orientation.h"

#include <Eigen/Core>
#include <atomic>

#include "core/reference/basis.h"
#include "core/validity/cell_batches.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kCellsPerTask = 4096;

/// Gradients of the straight-sided cell's basis at the centre of the reference cell: vertices × dimension.
Eigen::MatrixXd centre_gradients(Shape shape, int dimension) {
  const reference::ShapeInfo& cell = reference::info(shape);
  reference::Points centre = reference::Points::Zero(1, dimension);
  for (int v = 0; v < cell.vertices; ++v)
    for (int c = 0; c < dimension; ++c)
      centre(0, c) += cell.vertex[static_cast<std::size_t>(v)][static_cast<std::size_t>(c)] / cell.vertices;
  const auto gradients = reference::basis_gradients(shape, 1, reference::NodeSet::Equispaced, dimension, centre);
  Eigen::MatrixXd result(cell.vertices, dimension);
  for (int r = 0; r < dimension; ++r) result.col(r) = gradients[static_cast<std::size_t>(r)].row(0).transpose();
  return result;
}

/// det ∇χ_L at the centre of the straight-sided cell with these vertices.
double centre_jacobian(const HighOrderMesh& mesh, const std::int32_t* nodes, const Eigen::MatrixXd& gradients) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  const int d = mesh.dimension;
  matrix.topLeftCorner(d, d).setZero();
  for (Eigen::Index v = 0; v < gradients.rows(); ++v)
    for (int c = 0; c < d; ++c) {
      const double x = mesh.coordinates[3 * static_cast<std::size_t>(nodes[v]) + static_cast<std::size_t>(c)] -
                       mesh.coordinates[3 * static_cast<std::size_t>(nodes[0]) + static_cast<std::size_t>(c)];
      for (int r = 0; r < d; ++r) matrix(c, r) += x * gradients(v, r);
    }
  return matrix(0, 0) * (matrix(1, 1) * matrix(2, 2) - matrix(1, 2) * matrix(2, 1)) -
         matrix(0, 1) * (matrix(1, 0) * matrix(2, 2) - matrix(1, 2) * matrix(2, 0)) +
         matrix(0, 2) * (matrix(1, 0) * matrix(2, 1) - matrix(1, 1) * matrix(2, 0));
}

}  // namespace

double orientation(const HighOrderMesh& mesh, const Team& team) {
  const auto gradients = tables_for_cells<Eigen::MatrixXd>(
      mesh, [&](Shape shape, int) { return centre_gradients(shape, mesh.dimension); });
  const std::vector<CellBatch> batches = cell_batches(mesh, [](const ElementBlock&) { return kCellsPerTask; });
  std::atomic<std::size_t> negative = 0, cells = 0;
  team.for_ranges(batches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const CellBatch& batch = batches[b];
      const Eigen::MatrixXd& gradient = gradients.at({batch.block->shape, batch.block->order});
      std::size_t here = 0;
      for (std::size_t i = 0; i < batch.count; ++i) here += centre_jacobian(mesh, batch.nodes(i), gradient) < 0 ? 1 : 0;
      negative += here;
      cells += batch.count;
    }
  });
  return 2 * negative > cells ? -1 : 1;
}

}  // namespace varimesh::detail
