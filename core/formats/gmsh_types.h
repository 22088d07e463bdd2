// Gmsh's element type numbers, and the shapes and orders that they stand for.
#pragma once

#include <string>
#include <string_view>

#include "core/reference/shape.h"

namespace varimesh::formats {

/// What an element type number stands for.
struct GmshType {
  enum class Kind : std::uint8_t { Complete, Incomplete, Unknown };
  Kind kind = Kind::Unknown;
  Shape shape = Shape::Point;
  int order = 0;
};

/// The meaning of an element type number; for an incomplete ("serendipity") type the shape and order are told too.
GmshType gmsh_type(int number);

/// The number of the complete Lagrange element; 0 where Gmsh has none (order 10 of hexahedra, prisms and pyramids).
int gmsh_type_number(Shape shape, int order);

/// Why elements of that type number are refused, and what to do.
std::string gmsh_type_refusal(int number);

}  // namespace varimesh::formats
