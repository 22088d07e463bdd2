// GMF's keywords of elements, and how it gives places in them. Internal to core/formats.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/formats/numbering/node_order.h"
#include "core/reference/shape.h"

namespace varimesh::formats::gmf {

/// A keyword of elements, and that of the order of their nodes.
struct Keyword {
  std::string_view name;
  int code;
  int ordering;  ///< Code of the keyword with "Ordering" after the name; 0: there is none.
  Shape shape;
  int order;
};

constexpr std::array kElements = {
    Keyword{"Edges", 5, 141, Shape::Line, 1},
    Keyword{"Triangles", 6, 143, Shape::Triangle, 1},
    Keyword{"Quadrilaterals", 7, 145, Shape::Quadrilateral, 1},
    Keyword{"Tetrahedra", 8, 147, Shape::Tetrahedron, 1},
    Keyword{"Prisms", 9, 151, Shape::Prism, 1},
    Keyword{"Pentahedra", 9, 151, Shape::Prism, 1},
    Keyword{"Hexahedra", 10, 153, Shape::Hexahedron, 1},
    Keyword{"Hexaedra", 10, 153, Shape::Hexahedron, 1},
    Keyword{"Pyramids", 49, 149, Shape::Pyramid, 1},
    Keyword{"EdgesP2", 25, 127, Shape::Line, 2},
    Keyword{"TrianglesP2", 24, 129, Shape::Triangle, 2},
    Keyword{"QuadrilateralsQ2", 27, 131, Shape::Quadrilateral, 2},
    Keyword{"TetrahedraP2", 30, 133, Shape::Tetrahedron, 2},
    Keyword{"PrismsP2", 86, 137, Shape::Prism, 2},
    Keyword{"HexahedraQ2", 33, 139, Shape::Hexahedron, 2},
    Keyword{"PyramidsP2", 87, 135, Shape::Pyramid, 2},
    Keyword{"EdgesP3", 92, 128, Shape::Line, 3},
    Keyword{"TrianglesP3", 90, 130, Shape::Triangle, 3},
    Keyword{"QuadrilateralsQ3", 88, 132, Shape::Quadrilateral, 3},
    Keyword{"TetrahedraP3", 96, 134, Shape::Tetrahedron, 3},
    Keyword{"PrismsP3", 102, 138, Shape::Prism, 3},
    Keyword{"HexahedraQ3", 98, 140, Shape::Hexahedron, 3},
    Keyword{"PyramidsP3", 100, 136, Shape::Pyramid, 3},
    Keyword{"EdgesP4", 93, 142, Shape::Line, 4},
    Keyword{"TrianglesP4", 91, 144, Shape::Triangle, 4},
    Keyword{"QuadrilateralsQ4", 89, 146, Shape::Quadrilateral, 4},
    Keyword{"TetrahedraP4", 97, 148, Shape::Tetrahedron, 4},
    Keyword{"PrismsP4", 103, 152, Shape::Prism, 4},
    Keyword{"HexahedraQ4", 99, 154, Shape::Hexahedron, 4},
    Keyword{"PyramidsP4", 101, 150, Shape::Pyramid, 4},
};

/// How many numbers give a place in a shape: barycentric ones in simplices, and positions along axes.
inline int place_size(Shape shape) {
  switch (shape) {
    case Shape::Line:
      return 1;
    case Shape::Quadrilateral:
      return 2;
    case Shape::Triangle:
    case Shape::Hexahedron:
    case Shape::Pyramid:
      return 3;
    default:
      return 4;
  }
}

/// The position on the lattice. Barycentric numbers belong to the vertices in turn.
inline Position position_of(Shape shape, const std::array<std::int64_t, 4>& at) {
  const auto [a, b, c, d] = at;
  switch (shape) {
    case Shape::Triangle:
      return {int(b), int(c), 0};
    case Shape::Tetrahedron:
      return {int(b), int(c), int(d)};
    case Shape::Prism:
      return {int(b), int(c), int(d)};
    default:
      return {int(a), int(b), int(c)};
  }
}

/// Whether the order of nodes is the same in all programs.
inline bool has_usual_order(Shape shape, int order) {
  return order == 1 || shape == Shape::Line || (shape == Shape::Triangle && order < 4) ||
         ((shape == Shape::Quadrilateral || shape == Shape::Tetrahedron) && order == 2);
}

}  // namespace varimesh::formats::gmf
