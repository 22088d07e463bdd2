// VTK's cells: their types, and the nodes that they list. Internal to core/formats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// How VTK stores the cells of one shape and order.
struct VtkCell {
  std::uint8_t type = 0;   ///< VTK's cell type.
  std::vector<int> nodes;  ///< For each VTK node, the node in Gmsh's order; −1 for additional points of pyramids.
};

/// The VTK cell for the elements of a block, which may be serendipity elements of order 2.
VtkCell vtk_cell(const ElementBlock& block);

/// The VTK cell for a shape and order: VTK's linear cells for order 1, Lagrange cells for higher orders. Pyramids of
/// order 2 and above become Lagrange hexahedra whose top face is the apex. VTK 9.1 has no Lagrange pyramid, and its
/// quadratic pyramid lacks the node in the middle of the base. The functions of the pyramid are polynomials of the same
/// order on the hexahedron, so the geometry stays exact.
VtkCell vtk_cell(Shape shape, int order);

/// A cell of a VTK file.
struct VtkKind {
  Shape shape = Shape::Point;
  int order = 1;
  /// For each node in Gmsh's order, its place in the cell's list. Serendipity cells have fewer than complete ones.
  const std::vector<int>* places = nullptr;
};

/// The kind of a cell from VTK's type and its number of nodes. `new_order`: the file has version 2.1 or above, in which
/// two upright edges of Lagrange hexahedra have changed places. Errors: BadInput, without the place.
Expected<VtkKind> vtk_kind(std::int64_t type, std::size_t nodes, bool new_order);

/// A pyramid of order 2 and above is a hexahedron whose top face is its apex.
VtkKind vtk_pyramid(int order, bool new_order);

}  // namespace varimesh::formats
