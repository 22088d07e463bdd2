#include "core/formats/vtu/cells.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "core/formats/numbering/node_order.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/reference/cache.h"
#include "core/reference/serendipity.h"

namespace varimesh::formats {

namespace {

/// The inverse of a list of Gmsh's numbers in VTK's order; −1 in the list stands for a node that Gmsh does not have.
std::vector<int> inverse(const std::vector<int>& gmsh, std::size_t nodes) {
  std::vector<int> places(nodes, -1);
  for (std::size_t i = 0; i < gmsh.size(); ++i)
    if (gmsh[i] >= 0 && places[std::size_t(gmsh[i])] < 0) places[std::size_t(gmsh[i])] = int(i);
  return places;
}

/// Whether VTK's faces of a cell of this type point outwards, and its volume is positive, if the base (0, 1, 2) is
/// clockwise seen from the other triangle. vtkWedge's documentation says so of the types 13 (linear), 26, 31 and 32
/// (quadratic). Its parametric coordinates contradict it. Lagrange wedges, type 73, are numbered like Gmsh's.
constexpr bool is_mirrored(int type) { return type == 13 || type == 26 || type == 31 || type == 32; }

/// For each node of VTK's cell, the node in Gmsh's order; −1 for additional points of pyramids.
std::vector<int> listed_nodes(Shape shape, int order, bool mirrored) {
  std::vector<int> nodes;
  const std::vector<int>& node_at = nodes_by_position(shape, order);
  const auto side = std::size_t(order) + 1;
  for (const Position& position : node_positions(NodeOrder::Vtk, shape, order)) {
    Position at = position;
    if (mirrored) std::swap(at[0], at[1]);
    if (shape == Shape::Pyramid && order > 1) {
      // The pyramid has nodes for the hexahedron's corners, upright edges, base and top; other points are additional.
      const bool corner = (at[0] == 0 || at[0] == order) && (at[1] == 0 || at[1] == order);
      if (at[2] == order) {
        at = {0, 0, order};
      } else if (at[2] != 0 && !corner) {
        nodes.push_back(-1);
        continue;
      } else if (at[2] != 0) {
        for (std::size_t k = 0; k < 2; ++k) at[k] = at[k] == 0 ? 0 : order - at[2];
      }
    }
    nodes.push_back(node_at[std::size_t(at[0]) + side * (std::size_t(at[1]) + side * std::size_t(at[2]))]);
    assert(nodes.back() >= 0);
  }
  return nodes;
}

const std::vector<int>& places_of(Shape shape, int order, bool new_order, bool mirrored = false) {
  static reference::Cache<std::array<int, 4>, std::vector<int>> cache;
  return cache.get({int(shape), order, new_order ? 1 : 0, mirrored ? 1 : 0}, [&] {
    std::vector<int> gmsh = listed_nodes(shape, order, mirrored);
    const bool upright = order > 1 && (shape == Shape::Hexahedron || shape == Shape::Pyramid);
    if (new_order && upright) {
      // Eight corners, eight edges of the base and the top, then the upright edges above corners 0, 1, 3, 2.
      const auto inner = std::ptrdiff_t(order) - 1;
      const auto third = gmsh.begin() + 8 + 10 * inner;
      std::swap_ranges(third, third + inner, third + inner);
    }
    return inverse(gmsh, std::size_t(reference::node_count(shape, order)));
  });
}

/// VTK's cells of fixed order, from vtkCellType.h. Type 29 has the upright edges in the new order.
struct Fixed {
  int type;
  Shape shape;
  int order;
};
constexpr std::array<Fixed, 14> kFixed = {{{1, Shape::Point, 1},
                                           {3, Shape::Line, 1},
                                           {5, Shape::Triangle, 1},
                                           {9, Shape::Quadrilateral, 1},
                                           {10, Shape::Tetrahedron, 1},
                                           {12, Shape::Hexahedron, 1},
                                           {13, Shape::Prism, 1},
                                           {14, Shape::Pyramid, 1},
                                           {21, Shape::Line, 2},
                                           {22, Shape::Triangle, 2},
                                           {24, Shape::Tetrahedron, 2},
                                           {28, Shape::Quadrilateral, 2},
                                           {29, Shape::Hexahedron, 2},
                                           {32, Shape::Prism, 2}}};
/// VTK's serendipity cells, all of order 2.
constexpr std::array<std::pair<int, Shape>, 4> kSerendipity = {
    {{23, Shape::Quadrilateral}, {25, Shape::Hexahedron}, {26, Shape::Prism}, {27, Shape::Pyramid}}};
constexpr std::array<std::pair<int, Shape>, 6> kLagrange = {{{68, Shape::Line},
                                                             {69, Shape::Triangle},
                                                             {70, Shape::Quadrilateral},
                                                             {71, Shape::Tetrahedron},
                                                             {72, Shape::Hexahedron},
                                                             {73, Shape::Prism}}};

/// The nodes of a serendipity cell, by VTK's order: vertices and edges, which come first in the complete cell too.
std::vector<int> serendipity_nodes(Shape shape, int type) {
  // From vtkQuadraticPyramid's documentation: the edges of the base, then those to the apex.
  if (shape == Shape::Pyramid) return {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12};
  std::vector<int> nodes = listed_nodes(shape, 2, is_mirrored(type));
  // The upright edges of VTK's quadratic hexahedra have the new order.
  if (shape == Shape::Hexahedron) std::swap(nodes[18], nodes[19]);
  nodes.resize(std::size_t(reference::serendipity_node_count(shape, 2)));
  return nodes;
}

const std::vector<int>& serendipity_places(Shape shape, int type) {
  static reference::Cache<int, std::vector<int>> cache;
  return cache.get(type, [&] {
    const std::vector<int> nodes = serendipity_nodes(shape, type);
    return inverse(nodes, nodes.size());
  });
}

/// The type of the cells that are written.
std::uint8_t type_of(Shape shape, int order) {
  if (order == 1 || shape == Shape::Point)
    return std::uint8_t(
        std::find_if(kFixed.begin(), kFixed.end(), [&](const Fixed& fixed) { return fixed.shape == shape; })->type);
  const Shape written = shape == Shape::Pyramid ? Shape::Hexahedron : shape;
  return std::uint8_t(std::find_if(kLagrange.begin(), kLagrange.end(), [&](const auto& each) {
                        return each.second == written;
                      })->first);
}

std::string why_not(std::int64_t type) {
  switch (type) {
    case 74:
    case 37:
      return "is a pyramid of higher order, for which VTK has no function space that VariMesh shares";
    case 2:
    case 4:
    case 6:
    case 7:
    case 34:
    case 36:
    case 41:
    case 42:
      return "is no triangle, quadrilateral, tetrahedron, pyramid, prism or hexahedron; take such cells out, for "
             "example "
             "with ParaView's filter Extract Cells By Type";
    default:
      return type >= 75 && type <= 81 ? "is a Bézier cell; write Lagrange cells" : "is not known to VariMesh";
  }
}

}  // namespace

VtkCell vtk_cell(Shape shape, int order) {
  const std::uint8_t type = type_of(shape, order);
  return {type, listed_nodes(shape, order, is_mirrored(type))};
}

VtkCell vtk_cell(const ElementBlock& block) {
  if (!is_serendipity(block)) return vtk_cell(block.shape, block.order);
  const auto is_it = [&](const auto& each) { return each.second == block.shape; };
  const int type = std::find_if(kSerendipity.begin(), kSerendipity.end(), is_it)->first;
  return {std::uint8_t(type), serendipity_nodes(block.shape, type)};
}

Expected<VtkKind> vtk_kind(std::int64_t type, std::size_t nodes, bool new_order) {
  static const std::vector<int> kPixel = {0, 1, 3, 2}, kVoxel = {0, 1, 3, 2, 4, 5, 7, 6};
  const std::string cell = "a cell of VTK's type " + std::to_string(type);
  if (type == 8 && nodes == 4) return VtkKind{Shape::Quadrilateral, 1, &kPixel};
  if (type == 11 && nodes == 8) return VtkKind{Shape::Hexahedron, 1, &kVoxel};
  for (const Fixed& fixed : kFixed) {
    if (fixed.type != type) continue;
    if (nodes != std::size_t(reference::node_count(fixed.shape, fixed.order)))
      return bad_input(cell + " has " + std::to_string(nodes) + " nodes");
    return VtkKind{fixed.shape, fixed.order, &places_of(fixed.shape, fixed.order, true, is_mirrored(int(type)))};
  }
  for (const auto& [serendipity, shape] : kSerendipity) {
    if (serendipity != type) continue;
    if (nodes != std::size_t(reference::serendipity_node_count(shape, 2)))
      return bad_input(cell + " has " + std::to_string(nodes) + " nodes");
    return VtkKind{shape, 2, &serendipity_places(shape, serendipity)};
  }
  for (const auto& [lagrange, shape] : kLagrange) {
    if (lagrange != type) continue;
    for (int order = 1; order <= kMaxOrder; ++order)
      if (nodes == std::size_t(reference::node_count(shape, order)))
        return VtkKind{shape, order, &places_of(shape, order, new_order)};
    return bad_input(cell + " has " + std::to_string(nodes) + " nodes, which no " +
                     std::string(reference::info(shape).name) + " of order 1 to " + std::to_string(kMaxOrder) + " has");
  }
  return bad_input(cell + " " + why_not(type));
}

VtkKind vtk_pyramid(int order, bool new_order) {
  return {Shape::Pyramid, order, &places_of(Shape::Pyramid, order, new_order)};
}

}  // namespace varimesh::formats
