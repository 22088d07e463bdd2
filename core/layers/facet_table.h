// The places of a mesh's nodes, and the lattice and normals of facets of one shape. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

inline Eigen::Vector3d point(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Vector3d(&mesh.coordinates[3 * at(node)]);
}

/// The shortest straight edge of an element with these vertices, in the mesh's unit of length.
double shortest_edge(const HighOrderMesh& mesh, Shape shape, std::span<const std::int32_t> vertices);

/// What is the same for all facets of one shape: the lattice position of each node, and gradients of the basis there.
class FacetTable {
 public:
  FacetTable(Shape shape, int order, int dimension);

  /// The local number of the node at a position of the lattice; −1 if there is none.
  int node_at(std::array<int, 2> at) const;
  /// The unit normals of a facet at its nodes, to the side of `inward`. Where the facet is folded, the normal is that
  /// of the facet with straight sides.
  /// @param nodes of the facet, in Gmsh's order
  std::vector<Eigen::Vector3d> normals(const HighOrderMesh& mesh, std::span<const std::int32_t> nodes,
                                       const Eigen::Vector3d& inward) const;

 private:
  Shape shape_;
  std::map<std::array<int, 2>, int> node_at_;
  std::vector<Eigen::MatrixXd> gradients_;
};

}  // namespace varimesh::detail
