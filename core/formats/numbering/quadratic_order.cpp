// The node orders of Exodus and Abaqus, whose elements have orders 1 and 2.
#include <algorithm>
#include <string_view>

#include "core/formats/numbering/cgns_order.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

/// Vertices, edges as the table of sides has them, then what is left. `faces`: the faces of a hexahedron, whose middle
/// comes before them.
Positions quadratic(Sides format, Shape shape, std::array<std::string_view, 6> faces) {
  const auto& lattice = reference::lattice(shape, 2);
  const auto vertex = [&](int v) {
    return Position{lattice[std::size_t(v)][0], lattice[std::size_t(v)][1], lattice[std::size_t(v)][2]};
  };
  Positions list;
  for (int v = 0; v < reference::info(shape).vertices; ++v) list.push_back(vertex(v));
  for (const auto& [a, b] : edges_of(format, shape)) add_edge(list, vertex(a), vertex(b), 2);
  if (shape == Shape::Hexahedron) {
    list.push_back({1, 1, 1});
    for (const std::string_view face : faces) {
      const Position a = vertex(face[0] - '0'), b = vertex(face[2] - '0');
      list.push_back({(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2});
    }
  }
  // The faces of all others, and the inside, are as CGNS has them.
  for (const Position& at : cgns_positions(shape, 2))
    if (std::find(list.begin(), list.end(), at) == list.end()) list.push_back(at);
  return list;
}

}  // namespace

Positions exodus_positions(Shape shape, int order) {
  if (order != 2) return cgns_positions(shape, order);
  return quadratic(Sides::Exodus, shape, {"0123", "4567", "3047", "1265", "0154", "2376"});
}

Positions abaqus_positions(Shape shape, int order) {
  if (order != 2) return cgns_positions(shape, order);
  return quadratic(Sides::Abaqus, shape, {"0123", "4567", "0154", "1265", "2376", "3047"});
}

}  // namespace varimesh::formats
