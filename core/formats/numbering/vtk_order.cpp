// The positions of the nodes of VTK's Lagrange cells.
//
// VTK 9 defines its node order in the classes vtkHigherOrderTriangle, …Quadrilateral, …Tetra, …Hexahedron and …Wedge:
// vertices, edges, faces, interior. The edges and faces of tensor cells run along the axes. Those of simplices and of a
// prism's triangles go around the cell. The four upright edges of the hexahedron have the order of files below
// version 2.1, row by row.
#include <algorithm>
#include <array>
#include <cassert>

#include "core/formats/numbering/node_order.h"

namespace varimesh::formats {

namespace {

// A triangle with the given corners and `order` steps per edge: its vertices, its edges, and then the triangle of order
// − 3 inside it.
void add_triangle(Positions& list, Position a, Position b, Position c, int order) {
  for (; order > 0; order -= 3) {
    list.insert(list.end(), {a, b, c});
    add_edge(list, a, b, order);
    add_edge(list, b, c, order);
    add_edge(list, c, a, order);
    // One step from each corner towards each of the others.
    Position inner_a, inner_b, inner_c;
    for (std::size_t k = 0; k < 3; ++k) {
      inner_a[k] = a[k] + (b[k] + c[k] - 2 * a[k]) / order;
      inner_b[k] = b[k] + (a[k] + c[k] - 2 * b[k]) / order;
      inner_c[k] = c[k] + (a[k] + b[k] - 2 * c[k]) / order;
    }
    a = inner_a, b = inner_b, c = inner_c;
  }
  if (order == 0) list.push_back(a);
}

// Only the nodes strictly inside such a triangle.
void add_triangle_inside(Positions& list, const Position& a, const Position& b, const Position& c, int order) {
  Positions whole;
  add_triangle(whole, a, b, c, order);
  list.insert(list.end(), whole.begin() + std::ptrdiff_t{3} * order, whole.end());
}

Positions tetrahedron(int order) {
  constexpr std::array<std::array<std::size_t, 2>, 6> kEdges = {{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
  constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{0, 1, 3}, {2, 3, 1}, {0, 3, 2}, {0, 2, 1}}};
  Positions list;
  Position origin{0, 0, 0};
  for (; order > 0; order -= 4) {
    std::array<Position, 4> v{origin, origin, origin, origin};
    for (std::size_t k = 0; k < 3; ++k) v[k + 1][k] += order;
    list.insert(list.end(), v.begin(), v.end());
    for (const auto& [a, b] : kEdges) add_edge(list, v[a], v[b], order);
    for (const auto& [a, b, c] : kFaces) add_triangle_inside(list, v[a], v[b], v[c], order);
    for (int& x : origin) ++x;
  }
  if (order == 0) list.push_back(origin);
  return list;
}

Positions quadrilateral(int p) {
  Positions list{{0, 0, 0}, {p, 0, 0}, {p, p, 0}, {0, p, 0}};
  add_edge(list, {0, 0, 0}, {p, 0, 0}, p);
  add_edge(list, {p, 0, 0}, {p, p, 0}, p);
  add_edge(list, {0, p, 0}, {p, p, 0}, p);
  add_edge(list, {0, 0, 0}, {0, p, 0}, p);
  for (int j = 1; j < p; ++j) add_edge(list, {0, j, 0}, {p, j, 0}, p);
  return list;
}

Positions hexahedron(int p) {
  Positions list;
  for (int k : {0, p}) list.insert(list.end(), {{0, 0, k}, {p, 0, k}, {p, p, k}, {0, p, k}});
  for (int k : {0, p}) {
    add_edge(list, {0, 0, k}, {p, 0, k}, p);
    add_edge(list, {p, 0, k}, {p, p, k}, p);
    add_edge(list, {0, p, k}, {p, p, k}, p);
    add_edge(list, {0, 0, k}, {0, p, k}, p);
  }
  for (const auto& [i, j] : {std::pair(0, 0), {p, 0}, {0, p}, {p, p}}) add_edge(list, {i, j, 0}, {i, j, p}, p);
  for (int i : {0, p})
    for (int k = 1; k < p; ++k) add_edge(list, {i, 0, k}, {i, p, k}, p);
  for (int j : {0, p})
    for (int k = 1; k < p; ++k) add_edge(list, {0, j, k}, {p, j, k}, p);
  for (int k : {0, p})
    for (int j = 1; j < p; ++j) add_edge(list, {0, j, k}, {p, j, k}, p);
  for (int k = 1; k < p; ++k)
    for (int j = 1; j < p; ++j) add_edge(list, {0, j, k}, {p, j, k}, p);
  return list;
}

// The nodes inside a triangle of VTK's wedge, row by row. VTK's own triangle goes around instead.
void add_rows(Positions& list, int k, int p) {
  for (int j = 1; j < p; ++j)
    for (int i = 1; i + j < p; ++i) list.push_back({i, j, k});
}

Positions prism(int p) {
  Positions list;
  for (int k : {0, p}) list.insert(list.end(), {{0, 0, k}, {p, 0, k}, {0, p, k}});
  for (int k : {0, p}) {
    add_edge(list, {0, 0, k}, {p, 0, k}, p);
    add_edge(list, {p, 0, k}, {0, p, k}, p);
    add_edge(list, {0, p, k}, {0, 0, k}, p);
  }
  for (const auto& [i, j] : {std::pair(0, 0), {p, 0}, {0, p}}) add_edge(list, {i, j, 0}, {i, j, p}, p);
  for (int k : {0, p}) add_rows(list, k, p);
  for (int k = 1; k < p; ++k) add_edge(list, {0, 0, k}, {p, 0, k}, p);
  for (int k = 1; k < p; ++k) add_edge(list, {p, 0, k}, {0, p, k}, p);
  for (int k = 1; k < p; ++k) add_edge(list, {0, p, k}, {0, 0, k}, p);
  for (int k = 1; k < p; ++k) add_rows(list, k, p);
  return list;
}

}  // namespace

Positions vtk_positions(Shape shape, int order) {
  Positions list;
  switch (shape) {
    case Shape::Point:
      return {{0, 0, 0}};
    case Shape::Line:
      list = {{0, 0, 0}, {order, 0, 0}};
      add_edge(list, {0, 0, 0}, {order, 0, 0}, order);
      return list;
    case Shape::Triangle:
      add_triangle(list, {0, 0, 0}, {order, 0, 0}, {0, order, 0}, order);
      return list;
    case Shape::Quadrilateral:
      return quadrilateral(order);
    case Shape::Tetrahedron:
      return tetrahedron(order);
    case Shape::Prism:
      return prism(order);
    case Shape::Hexahedron:
      return hexahedron(order);
    case Shape::Pyramid:
      if (order == 1) return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}};
      return hexahedron(order);
  }
  return list;
}

}  // namespace varimesh::formats
