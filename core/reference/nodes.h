// The positions of the nodes of a cell, and the vertex, edge, face or interior that each belongs to.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::reference {

/// Families of nodes.
enum class NodeSet : std::uint8_t {
  Equispaced,  ///< The uniform lattice, as in Gmsh and VTK.
  Optimised,  ///< α-optimised (warp and blend) on simplices, Gauss–Lobatto–Legendre in tensor directions. In 3-D every
              ///< triangular face uses the tetrahedron's α, so that neighbours of any shape share their face nodes.
              ///< J. S. Hesthaven, T. Warburton, Nodal Discontinuous Galerkin Methods, Springer, 2008,
              ///< sections 6.1, 10.1.
};

/// Points in a reference cell: one row per point, dimension columns, row-major.
using Points = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Reference coordinates of the nodes, node_count(shape, order) × dimension, in Gmsh's node order: vertices, edges,
/// faces, interior, where faces and interior are ordered recursively in the same way. Node i of both sets belongs to
/// the same lattice position, so interpolation converts one set to the other without renumbering.
/// @param ambient the dimension of the mesh, 2 or 3, which decides the α of triangles
const Points& nodes(Shape shape, int order, NodeSet set, int ambient);

/// The smallest part of a cell that a node lies in.
struct NodePlace {
  /// 0: vertex, 1: edge, 2: face, 3: interior of a 3-D cell. The interior of a 2-D cell is face 0.
  std::int8_t dimension;
  /// The number of the vertex, edge or face in ShapeInfo.
  std::int8_t index;
};

/// The place of each node, in Gmsh's node order.
const std::vector<NodePlace>& node_places(Shape shape, int order);

/// Integer position (i, j, k) of each node on the uniform lattice. Unused directions are 0.
///   simplex            i + j + k ≤ order, reference coordinate −1 + 2 i / order
///   tensor direction   0 ≤ i ≤ order, reference coordinate −1 + 2 i / order
///   pyramid            i, j ≤ order − k, z = −1 + 2 k / order
const std::vector<std::array<std::int8_t, 3>>& lattice(Shape shape, int order);

/// Local node numbers of one facet, in Gmsh's node order of the facet's own shape. Its vertices are in the order of
/// ShapeInfo::facets.
const std::vector<int>& facet_nodes(Shape shape, int order, int facet);

/// How a cell of dimension 2 or 3 is numbered when it is turned over, from clockwise to counter-clockwise or back:
/// entry k is the local number that node k of the turned cell has in the cell as it was. To turn twice gives the cell
/// back. The nodes stay where they are; these vertices change places:
///   triangle        1 and 2
///   quadrilateral   1 and 3
///   tetrahedron     0 and 1
///   pyramid         0 and 2
///   prism           0 and 1, 3 and 4
///   hexahedron      0 and 2, 4 and 6
const std::vector<int>& turned_nodes(Shape shape, int order);

}  // namespace varimesh::reference
