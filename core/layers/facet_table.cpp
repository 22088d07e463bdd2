#include "core/layers/facet_table.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {

using Vector = Eigen::Vector3d;

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
  std::vector<Vector> normals;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Vector a = along.row(k);
    const Vector b = shape_ == Shape::Line ? Vector(0, 0, 1) : Vector(across.row(k));
    const Vector normal = a.cross(b).normalized();
    normals.push_back(normal.dot(inward) < 0 ? Vector(-normal) : normal);
  }
  return normals;
}

}  // namespace varimesh::detail
