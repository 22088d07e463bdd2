// The table of shapes. The numbers of vertices, edges and faces, and the outward orientation of faces, are those of the
// section "Node ordering" of the Gmsh reference manual.
#include "core/reference/shape.h"

#include <cassert>

namespace varimesh::reference {
namespace {

using Edge = std::array<std::int8_t, 2>;

constexpr Facet point(std::int8_t a) { return {Shape::Point, {a, -1, -1, -1}}; }
constexpr Facet line(std::int8_t a, std::int8_t b) { return {Shape::Line, {a, b, -1, -1}}; }
constexpr Facet triangle(std::int8_t a, std::int8_t b, std::int8_t c) { return {Shape::Triangle, {a, b, c, -1}}; }
constexpr Facet quadrilateral(std::int8_t a, std::int8_t b, std::int8_t c, std::int8_t d) {
  return {Shape::Quadrilateral, {a, b, c, d}};
}

constexpr std::array<Edge, 1> kLineEdges{{{0, 1}}};
constexpr std::array<Facet, 2> kLineFacets{point(0), point(1)};

constexpr std::array<Edge, 3> kTriangleEdges{{{0, 1}, {1, 2}, {2, 0}}};
constexpr std::array<Facet, 3> kTriangleFacets{line(0, 1), line(1, 2), line(2, 0)};
constexpr std::array<Facet, 1> kTriangleFaces{triangle(0, 1, 2)};

constexpr std::array<Edge, 4> kQuadrilateralEdges{{{0, 1}, {1, 2}, {2, 3}, {3, 0}}};
constexpr std::array<Facet, 4> kQuadrilateralFacets{line(0, 1), line(1, 2), line(2, 3), line(3, 0)};
constexpr std::array<Facet, 1> kQuadrilateralFaces{quadrilateral(0, 1, 2, 3)};

constexpr std::array<Edge, 6> kTetrahedronEdges{{{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}}};
constexpr std::array<Facet, 4> kTetrahedronFaces{triangle(0, 2, 1), triangle(0, 1, 3), triangle(0, 3, 2),
                                                 triangle(3, 1, 2)};

constexpr std::array<Edge, 8> kPyramidEdges{{{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 4}, {2, 3}, {2, 4}, {3, 4}}};
constexpr std::array<Facet, 5> kPyramidFaces{triangle(0, 1, 4), triangle(3, 0, 4), triangle(1, 2, 4), triangle(2, 3, 4),
                                             quadrilateral(0, 3, 2, 1)};

constexpr std::array<Edge, 9> kPrismEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 4}, {2, 5}, {3, 4}, {3, 5}, {4, 5}}};
constexpr std::array<Facet, 5> kPrismFaces{triangle(0, 2, 1), triangle(3, 4, 5), quadrilateral(0, 1, 4, 3),
                                           quadrilateral(0, 3, 5, 2), quadrilateral(1, 2, 5, 4)};

constexpr std::array<Edge, 12> kHexahedronEdges{
    {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}}};
constexpr std::array<Facet, 6> kHexahedronFaces{quadrilateral(0, 3, 2, 1), quadrilateral(0, 1, 5, 4),
                                                quadrilateral(0, 4, 7, 3), quadrilateral(1, 2, 6, 5),
                                                quadrilateral(2, 3, 7, 6), quadrilateral(4, 5, 6, 7)};

constexpr std::array<ShapeInfo, kShapes> kTable{{
    {Shape::Point, "point", "points", 0, 1, true, 1.0, {{{0, 0, 0}}}, {}, {}, {}},
    {Shape::Line, "line", "lines", 1, 2, true, 2.0, {{{-1, 0, 0}, {1, 0, 0}}}, kLineEdges, kLineFacets, {}},
    {Shape::Triangle,
     "triangle",
     "triangles",
     2,
     3,
     true,
     2.0,
     {{{-1, -1, 0}, {1, -1, 0}, {-1, 1, 0}}},
     kTriangleEdges,
     kTriangleFacets,
     kTriangleFaces},
    {Shape::Quadrilateral,
     "quadrilateral",
     "quadrilaterals",
     2,
     4,
     false,
     4.0,
     {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}},
     kQuadrilateralEdges,
     kQuadrilateralFacets,
     kQuadrilateralFaces},
    {Shape::Tetrahedron,
     "tetrahedron",
     "tetrahedra",
     3,
     4,
     true,
     4.0 / 3.0,
     {{{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}},
     kTetrahedronEdges,
     kTetrahedronFaces,
     kTetrahedronFaces},
    {Shape::Pyramid,
     "pyramid",
     "pyramids",
     3,
     5,
     false,
     8.0 / 3.0,
     {{{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {0, 0, 1}}},
     kPyramidEdges,
     kPyramidFaces,
     kPyramidFaces},
    {Shape::Prism,
     "prism",
     "prisms",
     3,
     6,
     false,
     4.0,
     {{{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1}}},
     kPrismEdges,
     kPrismFaces,
     kPrismFaces},
    {Shape::Hexahedron,
     "hexahedron",
     "hexahedra",
     3,
     8,
     false,
     8.0,
     {{{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}}},
     kHexahedronEdges,
     kHexahedronFaces,
     kHexahedronFaces},
}};

}  // namespace

const ShapeInfo& info(Shape shape) {
  const auto index = static_cast<std::size_t>(shape);
  assert(index < kTable.size());
  return kTable[index];
}

int node_count(Shape shape, int order) {
  const int p = order;
  switch (shape) {
    case Shape::Point:
      return 1;
    case Shape::Line:
      return p + 1;
    case Shape::Triangle:
      return (p + 1) * (p + 2) / 2;
    case Shape::Quadrilateral:
      return (p + 1) * (p + 1);
    case Shape::Tetrahedron:
      return (p + 1) * (p + 2) * (p + 3) / 6;
    case Shape::Pyramid:
      return (p + 1) * (p + 2) * (2 * p + 3) / 6;
    case Shape::Prism:
      return (p + 1) * (p + 1) * (p + 2) / 2;
    case Shape::Hexahedron:
      return (p + 1) * (p + 1) * (p + 1);
  }
  assert(false && "a shape that is not in the table");
  return 0;
}

}  // namespace varimesh::reference
