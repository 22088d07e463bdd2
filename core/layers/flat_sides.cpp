#include "core/layers/flat_sides.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// A facet is flat if no node lies farther from its plane than this, relative to its longest straight edge: files with
/// ten digits have such planes. Nodes keep their distance from the plane, so nothing adds up.
constexpr double kFlat = 1e-9;
/// Two sides have the same plane if the sine of their angle is at most the first, and two planes if it is more than the
/// second. Between them, the digits of the nodes of a thin facet do not tell, and nodes stay. A facet that is 1e-9
/// high, a unit from the origin, has a normal that is off by 1e-7.
constexpr double kSamePlane = 1e-6, kTwoPlanes = 0.01;

/// Whether all vertices are in columns, and two of them in the same one.
bool rises(const Columns& columns, std::span<const std::int32_t> vertices) {
  bool has_edge = false;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::int32_t column = columns.column_of[at(vertices[i])];
    if (column < 0) return false;
    for (std::size_t j = 0; j < i; ++j) has_edge = has_edge || columns.column_of[at(vertices[j])] == column;
  }
  return has_edge;
}

/// The unit normal of a facet, if the facet is flat.
std::optional<Vector> flat_normal(const HighOrderMesh& mesh, Shape shape, std::span<const std::int32_t> nodes) {
  const Vector from = point(mesh, nodes[0]), to = point(mesh, nodes[1]);
  Vector normal(from.y() - to.y(), to.x() - from.x(), 0);
  if (shape == Shape::Triangle) normal = (to - from).cross(point(mesh, nodes[2]) - from);
  if (shape == Shape::Quadrilateral) normal = (point(mesh, nodes[2]) - from).cross(point(mesh, nodes[3]) - to);
  if (!(normal.norm() > 0)) return std::nullopt;
  normal.normalize();
  double longest = 0;
  for (const auto& edge : reference::info(shape).edges)
    longest = std::max(longest, (point(mesh, nodes[at(edge[0])]) - point(mesh, nodes[at(edge[1])])).norm());
  if (shape == Shape::Line) longest = (to - from).norm();
  const bool is_flat = std::ranges::all_of(
      nodes, [&](std::int32_t node) { return std::abs(normal.dot(point(mesh, node) - from)) <= kFlat * longest; });
  return is_flat ? std::optional(normal) : std::nullopt;
}

bool are_of_one_side(const ElementBlock* a, const ElementBlock* b) {
  if (a == nullptr || b == nullptr) return a == b;
  return a->entity == b->entity && a->physical == b->physical;
}

/// By facet, as Facets counts: the block of its element of one dimension less; null if it has none.
std::vector<const ElementBlock*> blocks_of_elements(const HighOrderMesh& mesh, const Facets& facets) {
  const Cells elements(mesh, mesh.dimension - 1);
  std::vector<const ElementBlock*> blocks(facets.neighbour.size(), nullptr);
  for (const auto& [facet, element] : facets.elements) blocks[at(facet)] = elements.range_of(at(element)).block;
  return blocks;
}

}  // namespace

void FlatSides::Sides::add(const Vector& normal, const ElementBlock* block) {
  for (int i = 0; i < count; ++i) {
    const double sine = normals[at(i)].cross(normal).norm();
    if (sine > kTwoPlanes) continue;
    stays = stays || sine > kSamePlane || !are_of_one_side(blocks[at(i)], block);
    return;
  }
  stays = stays || count == 2;
  if (count == 2) return;
  blocks[at(count)] = block;
  normals[at(count++)] = normal;
}

FlatSides::FlatSides(const HighOrderMesh& mesh, const Facets& facets, const Columns& columns) {
  const Cells cells(mesh, mesh.dimension);
  const std::vector<const ElementBlock*> blocks = blocks_of_elements(mesh, facets);
  std::vector<std::int32_t> nodes;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const reference::ShapeInfo& info = reference::info(cells.shape(cell));
    for (std::size_t f = 0; f < info.facets.size(); ++f) {
      const std::size_t facet = at(facets.first[cell]) + f;
      if (facets.neighbour[facet] >= 0 && blocks[facet] == nullptr) continue;  // inside
      nodes.clear();
      for (const int local : reference::facet_nodes(cells.shape(cell), mesh.order, static_cast<int>(f)))
        nodes.push_back(cells.nodes(cell)[at(local)]);
      const Shape shape = info.facets[f].shape;
      const bool is_side = rises(columns, std::span(nodes).first(at(reference::info(shape).vertices)));
      const auto normal = is_side ? flat_normal(mesh, shape, nodes) : std::nullopt;
      for (const std::int32_t node : nodes) {
        Sides& sides = at_[node];
        if (normal)
          sides.add(*normal, blocks[facet]);
        else
          sides.stays = true;
      }
    }
  }
  for (const PeriodicLink& link : mesh.periodic)
    for (const auto& [node, image] : link.nodes)
      for (const std::int32_t linked : {node, image})
        if (const auto found = at_.find(linked); found != at_.end()) found->second.stays = true;
  std::erase_if(at_, [](const auto& entry) { return entry.second.stays; });
}

Vector FlatSides::along(std::int32_t node, const Vector& displacement) const {
  const Sides& sides = at_.at(node);
  const Vector& normal = sides.normals[0];
  if (sides.count == 1) return displacement - normal.dot(displacement) * normal;
  const Vector line = normal.cross(sides.normals[1]).normalized();
  return line.dot(displacement) * line;
}

}  // namespace varimesh::detail
