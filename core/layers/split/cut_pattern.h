// How a cell is cut into parts if some of its edges are. Internal to core/layers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::detail {

/// Edges of a cell that are cut together, each from its beginning to its end. In a cell with quadrilateral faces these
/// are parallel edges. In a triangle or tetrahedron an axis has one edge: the cell is cut into a fan.
struct CutAxis {
  std::array<std::array<std::int8_t, 2>, 4> edges{};
  int count = 0;
};

/// All axes along which cells of this shape can be cut.
std::span<const CutAxis> cut_axes(Shape shape);

/// Whether a cell can be cut along these axes at once: all those of a tensor product, one of a fan.
bool can_cut(Shape shape, std::span<const CutAxis* const> axes);

/// The most axes along which a cell is cut.
inline constexpr std::size_t kMostAxes = 3;

/// A point of the cut cell: a node of one or several parts.
struct CutPoint {
  int node = -1;      ///< The node of the parent that it is; −1: it is a new one.
  int dimension = 0;  ///< Of the part of the parent in which a new one lies: 1 edge, 2 face, 3 or the cell's: inside.
  int index = 0;      ///< Which edge or face of ShapeInfo.
  /// A new one on an edge: how many steps from its first vertex. On a quadrilateral: steps from its first vertex
  /// towards the second and towards the fourth. On a triangle: steps along the cut edge from its beginning, and the
  /// row, which is 0 at the opposite vertex and has row × parts steps.
  std::array<int, 2> at{};
  /// By axis: the part in which it lies, and where in the part, 0 … 1.
  std::array<int, kMostAxes> part{};
  std::array<double, kMostAxes> xi{};
  /// By axis and by edge of the axis: how much the edge decides where the point lies. They add up to 1.
  std::array<std::array<double, 4>, kMostAxes> weight{};
  std::array<double, 4> logical{};  ///< Logical coordinates if all parts are equal; see reference_of().
};

/// A face or edge of the parent that is cut, with how many steps it has in its two directions (1 for an edge).
/// For a triangle: steps of the cut edge per row, which are the parts, and the order.
struct CutFace {
  bool is_cut = false;
  std::array<int, 2> steps{};
  std::array<std::int8_t, 2> edge{-1, -1};  ///< Triangles: the local vertices of the cut edge, from its beginning.
};

/// How cells of one shape are cut along given axes into given numbers of parts.
struct CutPattern {
  Shape shape = Shape::Point;
  int order = 1;
  std::vector<CutAxis> axes;
  std::vector<int> parts;  ///< By axis.
  std::vector<CutPoint> points;
  std::vector<std::int32_t> nodes;  ///< Of the parts, part after part: indices of points, in Gmsh's order.
  int count = 1;                    ///< Of parts. The first axis runs fastest.
  int inner = 0;                    ///< How many points lie inside the cell.
  std::vector<CutFace> edges, faces;
  /// If the cell is cut along one axis that is no fan: for each point the order + 1 nodes of the parent on its line
  /// along the axis. Otherwise empty.
  std::vector<int> lines;
};

CutPattern make_pattern(Shape shape, int order, std::vector<CutAxis> axes, std::vector<int> parts);

/// The point of the reference cell at logical coordinates, in which axes are simple. Lines, quadrilaterals, hexahedra:
/// (1 + ξ)/2 in each direction. Triangles and tetrahedra: barycentric. Prisms: three barycentric ones and the height.
/// Pyramids: the two of the base, seen from the apex, and the height.
std::array<double, 3> reference_of(Shape shape, const std::array<double, 4>& logical);

/// Moves a point along an axis: its share of the way between the ends becomes `share`.
void set_share(Shape shape, const CutAxis& axis, double share, std::array<double, 4>& logical);

}  // namespace varimesh::detail
