// The shapes of cells as one table, which says how shapes differ.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace varimesh {

/// The shapes of cells, ordered by dimension.
enum class Shape : std::uint8_t { Point, Line, Triangle, Quadrilateral, Tetrahedron, Pyramid, Prism, Hexahedron };

inline constexpr int kShapes = 8;
inline constexpr int kMaxOrder = 10;

namespace reference {

/// A face of a 3-D cell or an edge of a 2-D cell: its shape and its vertices, counter-clockwise seen from outside.
struct Facet {
  Shape shape;
  std::array<std::int8_t, 4> vertices;  ///< Local vertex numbers. Unused entries are −1.
};

/// The properties of one shape. Reference cells have coordinates in [−1, 1]:
///   line            −1 … 1
///   triangle        (−1,−1), (1,−1), (−1,1)
///   quadrilateral   [−1,1]²
///   tetrahedron     (−1,−1,−1), (1,−1,−1), (−1,1,−1), (−1,−1,1)
///   pyramid         base [−1,1]² at z = −1, apex (0,0,1)
///   prism           triangle × [−1,1]
///   hexahedron      [−1,1]³
/// Vertices, edges and faces have Gmsh's numbers.
struct ShapeInfo {
  Shape shape;
  std::string_view name;    ///< "tetrahedron"
  std::string_view plural;  ///< "tetrahedra"
  int dimension;
  int vertices;
  bool affine;     ///< Whether the map of a straight-sided cell is affine: points, lines, triangles, tetrahedra.
  double measure;  ///< Length, area or volume of the reference cell: 2, 2, 4, 4/3, 8/3, 4, 8 from line to hexahedron.
  std::array<std::array<double, 3>, 8> vertex;        ///< Reference coordinates of the vertices.
  std::span<const std::array<std::int8_t, 2>> edges;  ///< Vertices of each edge.
  std::span<const Facet> facets;                      ///< (dimension − 1)-dimensional faces.
  std::span<const Facet> faces;                       ///< 2-D faces: the facets of a 3-D cell, or a 2-D cell itself.
};

/// The entry of the table for a shape.
const ShapeInfo& info(Shape shape);

/// The number of nodes of a complete Lagrange cell of this order, 1 ≤ order ≤ kMaxOrder.
int node_count(Shape shape, int order);

}  // namespace reference
}  // namespace varimesh
