// The order in which Gmsh numbers the nodes of a high-order cell: vertices, edges, faces, interior. The nodes of a face
// or of the interior are numbered like those of a smaller cell (Gmsh reference manual, "Node ordering", "High-order
// elements").
#include <cassert>
#include <map>

#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::reference {
namespace {

using Position = std::array<std::int8_t, 3>;
using Lattice = std::vector<Position>;

Lattice number_lattice(Shape shape, int order);

/// The lattice position of a vertex: `order` in each direction in which the reference coordinate is +1, otherwise 0.
/// The layers of a pyramid shrink towards their first corner, so the apex is (0, 0, order).
Position vertex_position(Shape shape, int vertex, int order) {
  if (shape == Shape::Pyramid && vertex == 4) return {0, 0, static_cast<std::int8_t>(order)};
  const ShapeInfo& cell = info(shape);
  Position position{};
  for (int c = 0; c < 3; ++c)
    if (cell.vertex[vertex][c] > 0) position[c] = static_cast<std::int8_t>(order);
  return position;
}

/// Converts a position in the lattice of a facet (line, triangle or quadrilateral) to the cell's lattice. The facet's
/// first vertex is the origin; its second and last vertices lie along the two directions.
Position facet_to_cell(Shape shape, const Facet& facet, const Position& in_facet, int order) {
  const int last = info(facet.shape).vertices - 1;
  const Position origin = vertex_position(shape, facet.vertices[0], order);
  Position position = origin;
  const std::array<int, 2> ends{1, last};
  for (int direction = 0; direction < info(facet.shape).dimension; ++direction) {
    const Position end = vertex_position(shape, facet.vertices[ends[direction]], order);
    for (int c = 0; c < 3; ++c)
      position[c] = static_cast<std::int8_t>(position[c] + (end[c] - origin[c]) / order * in_facet[direction]);
  }
  return position;
}

/// The order of the smaller cell of the same shape that the interior nodes form; negative if they form none. The inner
/// nodes of a line are numbered one after another, not as a smaller line.
int interior_order(Shape shape, int order) {
  switch (shape) {
    case Shape::Quadrilateral:
    case Shape::Hexahedron:
      return order - 2;
    case Shape::Triangle:
    case Shape::Pyramid:
      return order - 3;
    case Shape::Tetrahedron:
      return order - 4;
    case Shape::Point:
    case Shape::Line:
    case Shape::Prism:
      break;
  }
  return -1;
}

/// Interior positions of a prism. Gmsh does not number them as a smaller prism. For each triangle node it goes along
/// the third direction, in the order of the nodes of a line.
Lattice prism_interior(int order) {
  Lattice interior;
  if (order < 3) return interior;
  const Lattice line = number_lattice(Shape::Line, order - 2);
  for (const Position& t : number_lattice(Shape::Triangle, order - 3))
    for (const Position& l : line)
      interior.push_back(
          {static_cast<std::int8_t>(t[0] + 1), static_cast<std::int8_t>(t[1] + 1), static_cast<std::int8_t>(l[0] + 1)});
  return interior;
}

/// Positions strictly inside the cell, in Gmsh's order.
Lattice interior_positions(Shape shape, int order) {
  if (shape == Shape::Prism) return prism_interior(order);
  Lattice interior;
  if (shape == Shape::Line)
    for (int i = 1; i < order; ++i) interior.push_back({static_cast<std::int8_t>(i), 0, 0});
  const int smaller = interior_order(shape, order);
  if (smaller < 0) return interior;
  interior = number_lattice(shape, smaller);
  for (Position& position : interior)
    for (int c = 0; c < 3; ++c)
      position[c] = static_cast<std::int8_t>(position[c] + (c < info(shape).dimension ? 1 : 0));
  return interior;
}

Lattice number_lattice(Shape shape, int order) {
  const ShapeInfo& cell = info(shape);
  if (order == 0 || shape == Shape::Point) return {Position{}};
  Lattice positions;
  for (int v = 0; v < cell.vertices; ++v) positions.push_back(vertex_position(shape, v, order));
  if (cell.dimension >= 2) {
    for (const auto& edge : cell.edges)
      for (int i = 1; i < order; ++i)
        positions.push_back(facet_to_cell(shape, {Shape::Line, {edge[0], edge[1], -1, -1}},
                                          {static_cast<std::int8_t>(i), 0, 0}, order));
  }
  if (cell.dimension == 3) {
    for (const Facet& face : cell.faces)
      for (const Position& position : interior_positions(face.shape, order))
        positions.push_back(facet_to_cell(shape, face, position, order));
  }
  const Lattice interior = interior_positions(shape, order);
  positions.insert(positions.end(), interior.begin(), interior.end());
  assert(static_cast<int>(positions.size()) == node_count(shape, order));
  return positions;
}

std::vector<NodePlace> make_places(Shape shape, int order) {
  const ShapeInfo& cell = info(shape);
  std::vector<NodePlace> places;
  const auto append = [&](int count, int dimension, int index) {
    places.insert(places.end(), count, {static_cast<std::int8_t>(dimension), static_cast<std::int8_t>(index)});
  };
  for (int v = 0; v < cell.vertices; ++v) append(1, 0, v);
  for (std::size_t e = 0; e < cell.edges.size(); ++e) append(order - 1, 1, static_cast<int>(e));
  for (std::size_t f = 0; f < cell.faces.size(); ++f)
    append(static_cast<int>(interior_positions(cell.faces[f].shape, order).size()), 2, static_cast<int>(f));
  append(node_count(shape, order) - static_cast<int>(places.size()), 3, 0);
  return places;
}

/// The position that a node at this position has in the turned cell.
Position turned_position(Shape shape, const Position& at, int order) {
  const auto [i, j, k] = at;
  const auto steps = [](int number) { return static_cast<std::int8_t>(number); };
  switch (shape) {
    case Shape::Triangle:
    case Shape::Quadrilateral:
      return {j, i, k};
    case Shape::Tetrahedron:
      return {steps(order - i - j - k), j, k};
    case Shape::Pyramid:
      return {steps(order - k - j), steps(order - k - i), k};
    case Shape::Prism:
      return {steps(order - i - j), j, k};
    case Shape::Hexahedron:
      return {steps(order - j), steps(order - i), k};
    case Shape::Point:
    case Shape::Line:
      break;
  }
  assert(!"only cells are turned");
  return at;
}

/// The number of the node at each position of the lattice.
std::map<Position, int> numbers_by_position(Shape shape, int order) {
  std::map<Position, int> number;
  const Lattice& cell = lattice(shape, order);
  for (std::size_t n = 0; n < cell.size(); ++n) number[cell[n]] = static_cast<int>(n);
  return number;
}

}  // namespace

const std::vector<std::array<std::int8_t, 3>>& lattice(Shape shape, int order) {
  assert(order >= 1 && order <= kMaxOrder);
  static Cache<std::pair<Shape, int>, Lattice> cache;
  return cache.get({shape, order}, [&] { return number_lattice(shape, order); });
}

const std::vector<NodePlace>& node_places(Shape shape, int order) {
  assert(order >= 1 && order <= kMaxOrder);
  static Cache<std::pair<Shape, int>, std::vector<NodePlace>> cache;
  return cache.get({shape, order}, [&] { return make_places(shape, order); });
}

const std::vector<int>& facet_nodes(Shape shape, int order, int facet) {
  static Cache<std::array<int, 3>, std::vector<int>> cache;
  return cache.get({static_cast<int>(shape), order, facet}, [&] {
    const Facet& which = info(shape).facets[facet];
    const std::map<Position, int> number = numbers_by_position(shape, order);
    std::vector<int> found;
    for (const Position& position : lattice(which.shape, order))
      found.push_back(number.at(facet_to_cell(shape, which, position, order)));
    return found;
  });
}

const std::vector<int>& turned_nodes(Shape shape, int order) {
  static Cache<std::pair<Shape, int>, std::vector<int>> cache;
  return cache.get({shape, order}, [&] {
    const std::map<Position, int> number = numbers_by_position(shape, order);
    std::vector<int> turned;
    for (const Position& position : lattice(shape, order))
      turned.push_back(number.at(turned_position(shape, position, order)));
    return turned;
  });
}

}  // namespace varimesh::reference
