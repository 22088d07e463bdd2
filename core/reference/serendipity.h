// Serendipity cells: those without the nodes inside their faces and volume.
#pragma once

#include <Eigen/Core>

#include "core/reference/shape.h"

namespace varimesh::reference {

/// The number of nodes of the serendipity cell: vertices and nodes inside edges. They are the first nodes of the
/// complete cell, in Gmsh's order. 0 if the shape and order have no such cell whose functions are known: points, lines,
/// triangles of order 2, tetrahedra, and from order 3 on prisms and pyramids. Gmsh has tetrahedra of order 3 and more
/// too, but their functions on a face depend on which of its vertices comes first, so neighbours do not fit together.
int serendipity_node_count(Shape shape, int order);

/// What the functions of the serendipity cell are at the nodes that it lacks: (missing nodes, in Gmsh's order) × (nodes
/// of the serendipity cell). These functions are in the space of the complete cell of this order, so a complete cell
/// with its further nodes there has the same geometry.
///   quadrilateral, hexahedron   the edges blended linearly (W. J. Gordon, C. A. Hall, Int. J. Numer. Meth. Eng. 7,
///   1973);
///                               at order 2 these are the functions of the 8- and 20-node elements
///   prism, pyramid              order 2: on each quadrilateral face the functions of the 8-node quadrilateral
///   triangle                    from order 3 on: Gmsh's 1, x^i, y^i for i ≤ order, and x^i y^(order − i)
const Eigen::MatrixXd& serendipity_values(Shape shape, int order);

}  // namespace varimesh::reference
