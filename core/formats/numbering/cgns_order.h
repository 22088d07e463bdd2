// The element types of CGNS, and its order of nodes. Internal to core/formats.
#pragma once

#include <optional>

#include "core/formats/numbering/node_order.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// CGNS has elements up to this order.
inline constexpr int kMostCgnsOrder = 4;

/// What CGNS's ElementType_t says besides elements with all their nodes.
inline constexpr int kCgnsMixed = 20, kCgnsPolygons = 22, kCgnsPolyhedra = 23;

struct CgnsType {
  Shape shape = Shape::Point;
  int order = 1;
  std::size_t nodes =
      1;  ///< Serendipity elements have the first nodes of complete ones, in CGNS's order and in Gmsh's.
};

/// The number of an element type, for orders up to kMostCgnsOrder.
int cgns_type(Shape shape, int order);

/// The number of the type of serendipity elements; 0 if there is none.
int cgns_serendipity_type(Shape shape, int order);
/// The number of the type of a block's elements, which may be serendipity ones.
int cgns_type(const ElementBlock& block);

/// The element with this number; nothing if it cannot be read.
std::optional<CgnsType> cgns_element(std::int64_t type);

/// CGNS's order: vertices, edges, faces, interior. The nodes inside a quadrilateral follow a spiral from its border
/// inwards, and the interior of a cell consists of such layers. CGNS has no orders above 4; for them the rules go on.
Positions cgns_positions(Shape shape, int order);

}  // namespace varimesh::formats
