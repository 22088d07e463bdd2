#include "core/layers/facet_table.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {

using Vector = Eigen::Vector3d;

/// A facet that bends by more than this, the cosine of 84°, is folded there.
constexpr double kLeastLike = 0.1;

double shortest_edge(const HighOrderMesh& mesh, Shape shape, std::span<const std::int32_t> vertices) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const auto& edge : reference::info(shape).edges)
    shortest = std::min(shortest, (point(mesh, vertices[at(edge[0])]) - point(mesh, vertices[at(edge[1])])).norm());
  return shortest;
}

FacetTable::FacetTable(Shape shape, int order, int dimension) : shape_(shape) {
  const auto& lattice = reference::lattice(shape, order);
  for (std::size_t k = 0; k < lattice.size(); ++k) node_at_[{lattice[k][0], lattice[k][1]}] = static_cast<int>(k);
  gradients_ = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, dimension,
                                          reference::nodes(shape, order, reference::NodeSet::Equispaced, dimension));
}

int FacetTable::node_at(std::array<int, 2> at) const {
  const auto found = node_at_.find(at);
  return found == node_at_.end() ? -1 : found->second;
}

std::vector<Vector> FacetTable::normals(const HighOrderMesh& mesh, std::span<const std::int32_t> nodes,
                                        const Vector& inward) const {
  const auto count = static_cast<Eigen::Index>(nodes.size());
  Eigen::Matrix<double, Eigen::Dynamic, 3> x(count, 3);
  for (Eigen::Index k = 0; k < count; ++k) x.row(k) = point(mesh, nodes[at(k)]);
  const Eigen::MatrixXd along = gradients_[0] * x;
  const Eigen::MatrixXd across = shape_ == Shape::Line ? Eigen::MatrixXd() : Eigen::MatrixXd(gradients_[1] * x);
  // The cell beyond a curved facet may lean so much that a normal points away from its centre, but not that of the
  // facet with straight sides.
  const Vector from = point(mesh, nodes[0]), side = point(mesh, nodes[1]) - from;
  Vector straight =
      side.cross(shape_ == Shape::Line ? Vector(0, 0, 1) : Vector(point(mesh, nodes[2]) - from)).normalized();
  const double sign = straight.dot(inward) < 0 ? -1 : 1;
  straight *= sign;
  std::vector<Vector> normals;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Vector a = along.row(k);
    const Vector b = shape_ == Shape::Line ? Vector(0, 0, 1) : Vector(across.row(k));
    const Vector normal = sign * a.cross(b).normalized();
    normals.push_back(normal.dot(straight) > kLeastLike ? normal : straight);
  }
  return normals;
}

}  // namespace varimesh::detail
