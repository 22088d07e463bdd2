// Cells that stand on an element: a quadrilateral on a line, a prism on a triangle, a hexahedron on a quadrilateral.
// Internal to core/layers.
#pragma once

#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// The cell that stands on an element, and where its nodes are.
struct Extrusion {
  struct Node {
    int base = 0;   ///< The local node of the element below it.
    int level = 0;  ///< 0 … order, from the element up.
  };
  Shape shape = Shape::Quadrilateral;
  std::vector<Node> nodes;  ///< In Gmsh's node order of the cell.
};

/// The cell on an element of this shape: a line, a triangle or a quadrilateral; on a point it is a line. Its map is
/// positive if the element is numbered counter-clockwise seen from inside the cell, and a line from left to right with
/// the cell above it.
const Extrusion& extrusion(Shape base, int order);

}  // namespace varimesh::detail
