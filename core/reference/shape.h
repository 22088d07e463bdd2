// The shapes of cells, as entries of one table: what differs between a triangle and a hexahedron is said here.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace varimesh {

/// Shapes of cells, by the dimension of the cell.
enum class Shape : std::uint8_t { Point, Line, Triangle, Quadrilateral, Tetrahedron, Pyramid, Prism, Hexahedron };

inline constexpr int kShapes = 8;
inline constexpr int kMaxOrder = 10;

namespace reference {

/// A face of a 3-D cell or an edge of a 2-D one: its shape and its vertices, counter-clockwise seen from outside.
struct Facet {
  Shape shape;
  std::array<std::int8_t, 4> vertices;  ///< Local vertex numbers; −1 where there are fewer than four.
};

/// What is particular about one shape. Reference cells are those of the quadrature tables, with coordinates in [−1, 1]:
/// line (−1)…(1); triangle (−1,−1), (1,−1), (−1,1); quadrilateral [−1,1]²; tetrahedron (−1,−1,−1), (1,−1,−1),
/// (−1,1,−1), (−1,−1,1); hexahedron [−1,1]³; prism triangle × [−1,1]; pyramid base [−1,1]² at z = −1, apex (0,0,1).
/// Vertices, edges and faces are numbered as Gmsh numbers them.
struct ShapeInfo {
  Shape shape;
  std::string_view name;    ///< "tetrahedron"
  std::string_view plural;  ///< "tetrahedra"
  int dimension;
  int vertices;
  bool affine;     ///< A straight-sided cell's map is affine: points, lines, triangles, tetrahedra.
  double measure;  ///< Measure of the reference cell: 2, 2, 4, 4/3, 8/3, 4, 8 from line to hexahedron.
  std::array<std::array<double, 3>, 8> vertex;        ///< Reference coordinates of the vertices.
  std::span<const std::array<std::int8_t, 2>> edges;  ///< Vertices of each edge.
  std::span<const Facet> facets;                      ///< (dimension − 1)-dimensional faces.
  std::span<const Facet> faces;  ///< 2-D faces: of 3-D cells the facets, of 2-D cells the cell itself.
};

/// The table's entry for a shape.
const ShapeInfo& info(Shape shape);

/// Number of nodes of a complete Lagrange cell of that order (1 ≤ order ≤ kMaxOrder).
int node_count(Shape shape, int order);

}  // namespace reference
}  // namespace varimesh
