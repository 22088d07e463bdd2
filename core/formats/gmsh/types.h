// Gmsh's numbers of element types, and the shape and order that each stands for.
#pragma once

#include <string>
#include <string_view>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// An element type of Gmsh. Incomplete ("serendipity") elements lack inner nodes.
struct GmshType {
  enum class Kind : std::uint8_t { Complete, Incomplete, Unknown };
  Kind kind = Kind::Unknown;
  Shape shape = Shape::Point;
  int order = 0;
};

/// The element type with this number. Incomplete types have a shape and order too.
GmshType gmsh_type(int number);

/// How many nodes such an element has; 0 if it cannot be read.
int node_count(const GmshType& type);

/// The number of the complete Lagrange element; 0 if Gmsh has none (order 10 of hexahedra, prisms and pyramids).
int gmsh_type_number(Shape shape, int order);

/// The number of the type of a block's elements, which may be serendipity ones.
int gmsh_type_number(const ElementBlock& block);

/// Why elements of the type with this number are refused, and what to do.
std::string why_refused(int number);

}  // namespace varimesh::formats
