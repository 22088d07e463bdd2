#include "core/formats/vtu/cells.h"

#include <algorithm>
#include <array>

#include "core/formats/node_order.h"
#include "core/formats/vtu.h"
#include "core/reference/cache.h"

namespace varimesh::formats {

namespace {

/// The inverse of a list of Gmsh's numbers in VTK's order; −1 in the list stands for a node that Gmsh does not have.
std::vector<int> inverse(const std::vector<int>& gmsh, std::size_t nodes) {
  std::vector<int> places(nodes, -1);
  for (std::size_t i = 0; i < gmsh.size(); ++i)
    if (gmsh[i] >= 0 && places[std::size_t(gmsh[i])] < 0) places[std::size_t(gmsh[i])] = int(i);
  return places;
}

const std::vector<int>& places_of(Shape shape, int order, bool new_order) {
  static reference::Cache<std::array<int, 3>, std::vector<int>> cache;
  return cache.get({int(shape), order, new_order ? 1 : 0}, [&] {
    std::vector<int> gmsh = vtk_cell(shape, order).nodes;
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
constexpr std::array<std::pair<int, Shape>, 6> kLagrange = {{{68, Shape::Line},
                                                             {69, Shape::Triangle},
                                                             {70, Shape::Quadrilateral},
                                                             {71, Shape::Tetrahedron},
                                                             {72, Shape::Hexahedron},
                                                             {73, Shape::Prism}}};

std::string why_not(std::int64_t type) {
  switch (type) {
    case 23:
    case 25:
    case 26:
    case 27:
      return "is a serendipity cell, which has no nodes inside its faces; write Lagrange cells";
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
      return "is no triangle, quadrilateral, tetrahedron, pyramid, prism or hexahedron";
    default:
      return type >= 75 && type <= 81 ? "is a Bézier cell; write Lagrange cells" : "is not known to VariMesh";
  }
}

}  // namespace

Expected<VtkKind> vtk_kind(std::int64_t type, std::size_t nodes, bool new_order) {
  static const std::vector<int> kPixel = {0, 1, 3, 2}, kVoxel = {0, 1, 3, 2, 4, 5, 7, 6};
  const std::string cell = "a cell of VTK's type " + std::to_string(type);
  if (type == 8 && nodes == 4) return VtkKind{Shape::Quadrilateral, 1, &kPixel};
  if (type == 11 && nodes == 8) return VtkKind{Shape::Hexahedron, 1, &kVoxel};
  for (const Fixed& fixed : kFixed) {
    if (fixed.type != type) continue;
    if (nodes != std::size_t(reference::node_count(fixed.shape, fixed.order)))
      return bad_input(cell + " has " + std::to_string(nodes) + " nodes");
    return VtkKind{fixed.shape, fixed.order, &places_of(fixed.shape, fixed.order, true)};
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
