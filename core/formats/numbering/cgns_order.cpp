#include "core/formats/numbering/cgns_order.h"

#include <array>

#include "core/formats/numbering/sides.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/reference/nodes.h"
#include "core/reference/serendipity.h"

namespace varimesh::formats {

namespace {

struct Row {
  int type;
  Shape shape;
  int order;
};

constexpr std::array kTypes = {
    Row{2, Shape::Point, 1},          Row{3, Shape::Line, 1},          Row{4, Shape::Line, 2},
    Row{24, Shape::Line, 3},          Row{40, Shape::Line, 4},         Row{5, Shape::Triangle, 1},
    Row{6, Shape::Triangle, 2},       Row{26, Shape::Triangle, 3},     Row{42, Shape::Triangle, 4},
    Row{7, Shape::Quadrilateral, 1},  Row{9, Shape::Quadrilateral, 2}, Row{28, Shape::Quadrilateral, 3},
    Row{44, Shape::Quadrilateral, 4}, Row{10, Shape::Tetrahedron, 1},  Row{11, Shape::Tetrahedron, 2},
    Row{30, Shape::Tetrahedron, 3},   Row{47, Shape::Tetrahedron, 4},  Row{12, Shape::Pyramid, 1},
    Row{13, Shape::Pyramid, 2},       Row{33, Shape::Pyramid, 3},      Row{50, Shape::Pyramid, 4},
    Row{14, Shape::Prism, 1},         Row{16, Shape::Prism, 2},        Row{36, Shape::Prism, 3},
    Row{53, Shape::Prism, 4},         Row{17, Shape::Hexahedron, 1},   Row{19, Shape::Hexahedron, 2},
    Row{39, Shape::Hexahedron, 3},    Row{56, Shape::Hexahedron, 4},
};

/// QUAD_8, QUAD_12, QUAD_P4_16, HEXA_20, HEXA_32, HEXA_44, PENTA_15 and PYRA_13.
constexpr std::array kSerendipity = {Row{8, Shape::Quadrilateral, 2},  Row{27, Shape::Quadrilateral, 3},
                                     Row{43, Shape::Quadrilateral, 4}, Row{18, Shape::Hexahedron, 2},
                                     Row{37, Shape::Hexahedron, 3},    Row{54, Shape::Hexahedron, 4},
                                     Row{15, Shape::Prism, 2},         Row{21, Shape::Pyramid, 2}};

/// The (i, j) of a square with 1 ≤ i, j ≤ n along a spiral from (1, 1) inwards: right, up, left, down.
std::vector<std::array<int, 2>> spiral(int n) {
  std::vector<std::array<int, 2>> all;
  for (int low = 1, high = n; low <= high; ++low, --high) {
    if (low == high) {
      all.push_back({low, low});
      break;
    }
    for (int i = low; i < high; ++i) all.push_back({i, low});
    for (int j = low; j < high; ++j) all.push_back({high, j});
    for (int i = high; i > low; --i) all.push_back({i, high});
    for (int j = high; j > low; --j) all.push_back({low, j});
  }
  return all;
}

/// The (i, j) inside a triangle of this order, row by row.
std::vector<std::array<int, 2>> triangle(int order) {
  std::vector<std::array<int, 2>> all;
  for (int j = 1; j < order; ++j)
    for (int i = 1; i < order - j; ++i) all.push_back({i, j});
  return all;
}

Position step(const Position& origin, const Position& a, const Position& b, int i, int j, int order) {
  Position at;
  for (std::size_t k = 0; k < 3; ++k)
    at[k] = origin[k] + (a[k] - origin[k]) / order * i + (b[k] - origin[k]) / order * j;
  return at;
}

}  // namespace

int cgns_type(Shape shape, int order) {
  for (const Row& row : kTypes)
    if (row.shape == shape && row.order == order) return row.type;
  return 0;
}

int cgns_serendipity_type(Shape shape, int order) {
  for (const Row& row : kSerendipity)
    if (row.shape == shape && row.order == order) return row.type;
  return 0;
}

int cgns_type(const ElementBlock& block) {
  return is_serendipity(block) ? cgns_serendipity_type(block.shape, block.order) : cgns_type(block.shape, block.order);
}

std::optional<CgnsType> cgns_element(std::int64_t type) {
  for (const Row& row : kTypes)
    if (row.type == type)
      return CgnsType{row.shape, row.order, std::size_t(reference::node_count(row.shape, row.order))};
  for (const Row& row : kSerendipity)
    if (row.type == type)
      return CgnsType{row.shape, row.order, std::size_t(reference::serendipity_node_count(row.shape, row.order))};
  return std::nullopt;
}

Positions cgns_positions(Shape shape, int order) {
  Positions list;
  const auto& lattice = reference::lattice(shape, order);
  const auto vertex = [&](int v) {
    return Position{lattice[std::size_t(v)][0], lattice[std::size_t(v)][1], lattice[std::size_t(v)][2]};
  };
  for (int v = 0; v < reference::info(shape).vertices; ++v) list.push_back(vertex(v));
  for (const auto& [a, b] : edges_of(Sides::CgnsNodes, shape)) add_edge(list, vertex(a), vertex(b), order);
  for (const auto& [kind, v] : faces_of(Sides::CgnsNodes, shape)) {
    const bool is_triangle = kind == Shape::Triangle;
    for (const auto& [i, j] : is_triangle ? triangle(order) : spiral(order - 1))
      list.push_back(step(vertex(v[0]), vertex(v[1]), vertex(is_triangle ? v[2] : v[3]), i, j, order));
  }
  switch (shape) {
    case Shape::Triangle:
      for (const auto& [i, j] : triangle(order)) list.push_back({i, j, 0});
      break;
    case Shape::Quadrilateral:
      for (const auto& [i, j] : spiral(order - 1)) list.push_back({i, j, 0});
      break;
    case Shape::Tetrahedron:
      for (int k = 1; k < order; ++k)
        for (const auto& [i, j] : triangle(order - k)) list.push_back({i, j, k});
      break;
    case Shape::Pyramid:
      for (int k = 1; k < order; ++k)
        for (const auto& [i, j] : spiral(order - k - 1)) list.push_back({i, j, k});
      break;
    case Shape::Prism:
      for (int k = 1; k < order; ++k)
        for (const auto& [i, j] : triangle(order)) list.push_back({i, j, k});
      break;
    case Shape::Hexahedron:
      for (int k = 1; k < order; ++k)
        for (const auto& [i, j] : spiral(order - 1)) list.push_back({i, j, k});
      break;
    default:
      break;
  }
  return list;
}

}  // namespace varimesh::formats
