#include "core/formats/sides/sides.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <vector>

namespace varimesh::formats {

namespace {

using Vertices = std::array<std::int8_t, 4>;

std::vector<Vertices> vertices_of(Shape shape) {
  switch (shape) {
    case Shape::Triangle:
      return {{0, 1, -1, -1}, {1, 2, -1, -1}, {2, 0, -1, -1}};
    case Shape::Quadrilateral:
      return {{0, 1, -1, -1}, {1, 2, -1, -1}, {2, 3, -1, -1}, {3, 0, -1, -1}};
    case Shape::Tetrahedron:
      return {{0, 2, 1, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}};
    case Shape::Pyramid:
      return {{0, 3, 2, 1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}};
    case Shape::Prism:
      return {{0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}, {0, 2, 1, -1}, {3, 4, 5, -1}};
    case Shape::Hexahedron:
      return {{0, 3, 2, 1}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {0, 4, 7, 3}, {4, 5, 6, 7}};
    default:
      return {};
  }
}

int facet_with(Shape shape, Vertices vertices) {
  std::sort(vertices.begin(), vertices.end());
  const auto facets = reference::info(shape).facets;
  for (std::size_t f = 0; f < facets.size(); ++f) {
    Vertices own = facets[f].vertices;
    std::sort(own.begin(), own.end());
    if (own == vertices) return int(f);
  }
  assert(!"every side is a facet");
  return 0;
}

std::array<std::vector<CgnsSide>, kShapes> all_sides() {
  std::array<std::vector<CgnsSide>, kShapes> all;
  for (int shape = 0; shape < kShapes; ++shape)
    for (const Vertices& vertices : vertices_of(Shape(shape)))
      all[std::size_t(shape)].push_back(
          {4 - int(std::count(vertices.begin(), vertices.end(), -1)), vertices, facet_with(Shape(shape), vertices)});
  return all;
}

}  // namespace

std::span<const CgnsSide> cgns_sides(Shape shape) {
  static const std::array<std::vector<CgnsSide>, kShapes> all = all_sides();
  return all[std::size_t(shape)];
}

}  // namespace varimesh::formats
