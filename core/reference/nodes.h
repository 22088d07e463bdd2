// Where the nodes of a cell lie, and which vertex, edge, face or interior each belongs to.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::reference {

/// Families of nodes.
enum class NodeSet : std::uint8_t {
  Equispaced,  ///< Gmsh's and VTK's nodes: the uniform lattice.
  Optimised,  ///< α-optimised (warp and blend) on simplices, Gauss–Lobatto–Legendre in tensor directions; in 3-D every
              ///< triangular face uses the tetrahedron's α, so that neighbours of any shape share their face nodes.
              ///< J. S. Hesthaven, T. Warburton, Nodal Discontinuous Galerkin Methods, Springer, 2008,
              ///< sections 6.1, 10.1.
};

/// Points in a reference cell: one row a point, shape.dimension columns, row-major.
using Points = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Reference coordinates of the nodes, node_count(shape, order) × dimension, in Gmsh's node order (vertices, edges,
/// faces, interior, each recursively). Node i of either set belongs to the same lattice position, so one is converted
/// to the other by interpolation alone, without renumbering. `ambient` is the dimension of the mesh (2 or 3), which
/// decides the α of triangles.
const Points& nodes(Shape shape, int order, NodeSet set, int ambient);

/// The smallest part of a cell that a node lies in.
struct NodePlace {
  /// 0 vertex, 1 edge, 2 face, 3 interior of a 3-D cell (in a 2-D cell the interior is face 0).
  std::int8_t dimension;
  /// Which vertex, edge or face of the cell (ShapeInfo's numbering).
  std::int8_t index;
};

/// The place of each node, in Gmsh's node order.
const std::vector<NodePlace>& node_places(Shape shape, int order);

/// Integer position of each node on the uniform lattice: for a simplex (i, j, k) with i + j + k ≤ order, reference
/// coordinate −1 + 2 i / order; for a tensor direction the same with 0 ≤ i ≤ order; for a pyramid (i, j, k) with
/// i, j ≤ order − k, z = −1 + 2 k / order. Unused directions are 0.
const std::vector<std::array<std::int8_t, 3>>& lattice(Shape shape, int order);

/// Local node numbers of facet `facet`, in the Gmsh node order of the facet's own shape (its vertices in
/// ShapeInfo::facets' order).
const std::vector<int>& facet_nodes(Shape shape, int order, int facet);

}  // namespace varimesh::reference
