// The table of node orders, and the orders that are a few loops over the lattice.
#include "core/formats/numbering/node_order.h"

#include <cassert>

#include "core/formats/numbering/cgns_order.h"
#include "core/formats/numbering/sides.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

Position along(const Position& from, const Position& to, int steps, int of) {
  Position at;
  for (std::size_t k = 0; k < 3; ++k) at[k] = from[k] + (to[k] - from[k]) / of * steps;
  return at;
}

Positions gmsh_positions(Shape shape, int order) {
  Positions list;
  for (const auto& at : reference::lattice(shape, order)) list.push_back({at[0], at[1], at[2]});
  return list;
}

bool on_lattice(Shape shape, const Position& at, int order) {
  const auto [i, j, k] = at;
  switch (shape) {
    case Shape::Point:
      return i + j + k == 0;
    case Shape::Line:
      return j + k == 0;
    case Shape::Triangle:
      return i + j <= order && k == 0;
    case Shape::Quadrilateral:
      return k == 0;
    case Shape::Tetrahedron:
      return i + j + k <= order;
    case Shape::Pyramid:
      return i + k <= order && j + k <= order;
    case Shape::Prism:
      return i + j <= order;
    case Shape::Hexahedron:
      return true;
  }
  return false;
}

bool inside(Shape shape, const Position& at, int order) {
  const int d = reference::info(shape).dimension;
  for (int k = 0; k < d; ++k)
    if (at[std::size_t(k)] == 0) return false;
  // One step further in every direction is still on the lattice if the position is not on a far side.
  const auto [i, j, k] = at;
  switch (shape) {
    case Shape::Triangle:
      return i + j < order;
    case Shape::Tetrahedron:
      return i + j + k < order;
    case Shape::Pyramid:
      return i + k < order && j + k < order;
    case Shape::Prism:
      return i + j < order && k < order;
    default:
      return i < order && j < order && k < order;
  }
}

// The positions of a cell that `keep` accepts, row by row.
template <class Keep>
void add_rows_if(Positions& list, Shape shape, int order, const Keep& keep) {
  const int d = reference::info(shape).dimension;
  for (int k = 0; k <= (d > 2 ? order : 0); ++k)
    for (int j = 0; j <= (d > 1 ? order : 0); ++j)
      for (int i = 0; i <= (d > 0 ? order : 0); ++i)
        if (on_lattice(shape, {i, j, k}, order) && keep(Position{i, j, k})) list.push_back({i, j, k});
}

Positions rows(Shape shape, int order) {
  Positions list;
  add_rows_if(list, shape, order, [](const Position&) { return true; });
  return list;
}

Positions mfem_positions(Shape shape, int order) {
  Positions list;
  const reference::ShapeInfo& cell = reference::info(shape);
  const auto& lattice = reference::lattice(shape, order);
  for (int v = 0; v < cell.vertices; ++v)
    list.push_back({lattice[std::size_t(v)][0], lattice[std::size_t(v)][1], lattice[std::size_t(v)][2]});
  const Positions vertices = list;
  const auto vertex = [&](std::int8_t v) { return vertices[std::size_t(v)]; };
  if (cell.dimension > 1)
    for (const auto& [a, b] : edges_of(Sides::Mfem, shape)) add_edge(list, vertex(a), vertex(b), order);
  if (cell.dimension > 2)
    for (const reference::Facet& face : faces_of(Sides::Mfem, shape)) {
      const int last = reference::info(face.shape).vertices - 1;
      add_face_rows(list, vertex(face.vertices[0]), vertex(face.vertices[1]), vertex(face.vertices[std::size_t(last)]),
                    order, face.shape == Shape::Triangle);
    }
  if (cell.dimension > 0) add_rows_if(list, shape, order, [&](const Position& at) { return inside(shape, at, order); });
  return list;
}

Positions nektar_positions(Shape shape, int order) {
  if (shape != Shape::Triangle) return rows(shape, order);
  const Position a{0, 0, 0}, b{order, 0, 0}, c{0, order, 0};
  Positions list{a, b, c};
  add_edge(list, a, b, order);
  add_edge(list, b, c, order);
  add_edge(list, c, a, order);
  add_face_rows(list, a, b, c, order, true);
  return list;
}

// One row per node order.
constexpr std::array kTable = {
    NodeOrderEntry{NodeOrder::Gmsh, "gmsh", "Gmsh reference manual, section \"Node ordering\"", gmsh_positions},
    NodeOrderEntry{
        NodeOrder::Vtk, "vtk",
        "VTK's documentation of vtkHigherOrderTriangle, ...Quadrilateral, ...Tetra, ...Hexahedron and ...Wedge; "
        "vtkCellType.h",
        vtk_positions},
    NodeOrderEntry{NodeOrder::Mfem, "mfem",
                   "mfem.org, \"Mesh formats\" and \"Finite elements\"; Geometry::Constants (edges and faces) and "
                   "H1_FECollection (order within them) in MFEM's documentation of its classes",
                   mfem_positions},
    NodeOrderEntry{
        NodeOrder::Rows, "rows",
        "MFEM's documentation of L2_FECollection; HOPR's user guide, \"HOPR HDF5 Curved Mesh Format\"; PyFR's "
        "shapes of elements (std_ele)",
        rows},
    NodeOrderEntry{
        NodeOrder::Cgns, "cgns",
        "CGNS SIDS, \"Unstructured Grid Element Numbering Conventions\", and its extensions to cubic and quartic "
        "elements",
        cgns_positions},
    NodeOrderEntry{
        NodeOrder::Nektar, "nektar",
        "Nektar++ developer guide, \"NodalTriEvenlySpaced\" and \"PolyEvenlySpaced\"; user guide, \"Curved\"",
        nektar_positions},
    NodeOrderEntry{NodeOrder::Exodus, "exodus", "\"Exodus: A Finite Element Data Model\", SAND92-2137, elements",
                   exodus_positions},
    NodeOrderEntry{NodeOrder::Abaqus, "abaqus", "Abaqus' manual, solid element libraries, \"Node ordering\"",
                   abaqus_positions},
};

}  // namespace

void add_edge(Positions& list, const Position& from, const Position& to, int order) {
  for (int k = 1; k < order; ++k) list.push_back(along(from, to, k, order));
}

void add_face_rows(Positions& list, const Position& origin, const Position& first, const Position& second, int order,
                   bool triangle) {
  for (int j = 1; j < order; ++j)
    for (int i = 1; i < (triangle ? order - j : order); ++i) {
      const Position a = along(origin, first, i, order), b = along(origin, second, j, order);
      list.push_back({a[0] + b[0] - origin[0], a[1] + b[1] - origin[1], a[2] + b[2] - origin[2]});
    }
}

std::span<const NodeOrderEntry> node_orders() { return kTable; }

const Positions& node_positions(NodeOrder node_order, Shape shape, int order) {
  static reference::Cache<std::array<int, 3>, Positions> cache;
  return cache.get({int(node_order), int(shape), order}, [&] {
    for (const NodeOrderEntry& entry : kTable)
      if (entry.order == node_order) return entry.positions(shape, order);
    assert(!"the table has every order");
    return Positions{};
  });
}

const std::vector<int>& nodes_by_position(Shape shape, int order) {
  static reference::Cache<std::array<int, 2>, std::vector<int>> cache;
  return cache.get({int(shape), order}, [&] {
    const auto side = std::size_t(order) + 1;
    std::vector<int> nodes(side * side * side, -1);
    const auto& lattice = reference::lattice(shape, order);
    for (std::size_t n = 0; n < lattice.size(); ++n)
      nodes[std::size_t(lattice[n][0]) + side * (std::size_t(lattice[n][1]) + side * std::size_t(lattice[n][2]))] =
          int(n);
    return nodes;
  });
}

const std::vector<int>& gmsh_nodes(NodeOrder node_order, Shape shape, int order) {
  static reference::Cache<std::array<int, 3>, std::vector<int>> cache;
  return cache.get({int(node_order), int(shape), order}, [&] {
    const std::vector<int>& by_position = nodes_by_position(shape, order);
    const auto side = std::size_t(order) + 1;
    std::vector<int> nodes;
    for (const auto& [i, j, k] : node_positions(node_order, shape, order)) {
      nodes.push_back(by_position[std::size_t(i) + side * (std::size_t(j) + side * std::size_t(k))]);
      assert(nodes.back() >= 0);
    }
    return nodes;
  });
}

}  // namespace varimesh::formats
