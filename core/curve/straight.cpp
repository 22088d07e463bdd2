#include "core/curve/straight.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <set>

#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

/// Neighbours whose normals differ by less than this, in radians, lie in one plane.
constexpr double kFlat = 1e-6;
/// Neighbours whose normals differ by more meet in an edge. A cylinder of six elements turns by 1.05 at each.
constexpr double kEdge = 1.2;

struct Element {
  Eigen::Vector3d normal;
  std::vector<std::int32_t> vertices;
};

/// Of the straight-sided element.
Eigen::Vector3d normal_of(const HighOrderMesh& mesh, const std::vector<std::int32_t>& vertices) {
  const auto x = [&](std::size_t k) {
    return Eigen::Vector3d(
        Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(vertices[k])]));
  };
  const std::size_t last = vertices.size() - 1;
  return last == 2 ? (x(1) - x(0)).cross(x(2) - x(0)).normalized() : (x(2) - x(0)).cross(x(3) - x(1)).normalized();
}

std::vector<Element> with_held_new_nodes(const HighOrderMesh& mesh, const Association& association) {
  std::vector<Element> result;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != 2) continue;
    const auto stride = static_cast<std::ptrdiff_t>(reference::node_count(block.shape, block.order));
    for (auto first = block.nodes.begin(); first != block.nodes.end(); first += stride) {
      const auto first_new = first + reference::info(block.shape).vertices;
      const bool is_held = std::any_of(first_new, first + stride, [&](std::int32_t node) {
        return association.nodes[static_cast<std::size_t>(node)].dimension < 0;
      });
      if (!is_held) continue;
      const std::vector<std::int32_t> vertices(first, first_new);
      result.push_back({normal_of(mesh, vertices), vertices});
    }
  }
  return result;
}

/// An edge with a new node that belongs to no entity, and the element that it is of.
struct HeldEdge {
  Eigen::Vector3d along;  ///< From the end at which it is listed.
  std::int64_t element;
};

std::int64_t count_in_plane(const HighOrderMesh& mesh, const Association& association) {
  std::map<std::int32_t, std::vector<HeldEdge>> at;  // by end
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != 2) continue;
    const auto stride = block.nodes.size() / std::max<std::size_t>(block.size(), 1);
    for (std::size_t e = 0; e < block.size(); ++e)
      for (int f = 0; f < reference::info(block.shape).vertices; ++f) {
        const std::vector<int>& local = reference::facet_nodes(block.shape, block.order, f);
        const auto node = [&](std::size_t k) { return block.nodes[e * stride + static_cast<std::size_t>(local[k])]; };
        if (association.nodes[static_cast<std::size_t>(node(2))].dimension >= 0) continue;
        const auto x = [&](std::size_t k) {
          return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(node(k))]);
        };
        at[node(0)].push_back({x(1) - x(0), block.numbers[e]});
        at[node(1)].push_back({x(0) - x(1), block.numbers[e]});
      }
  }
  std::set<std::int64_t> straight;
  for (const auto& [end, edges] : at) {
    if (edges.size() != 2) continue;
    const Eigen::Vector3d &one = edges[0].along, other = -edges[1].along;
    const double angle = std::atan2(one.cross(other).norm(), one.dot(other));
    if (angle <= kFlat || angle >= kEdge) continue;
    for (const HeldEdge& edge : edges) straight.insert(edge.element);
  }
  return std::ssize(straight);
}

}  // namespace

std::int64_t count_straight_elements(const HighOrderMesh& mesh, const Association& association) {
  if (association.in_plane) return count_in_plane(mesh, association);
  const std::vector<Element> elements = with_held_new_nodes(mesh, association);
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<std::size_t>> edges;
  for (std::size_t e = 0; e < elements.size(); ++e)
    for (std::size_t k = 0; k < elements[e].vertices.size(); ++k) {
      const auto& own = elements[e].vertices;
      edges[std::minmax(own[k], own[(k + 1) % own.size()])].push_back(e);
    }
  std::set<std::size_t> straight;
  for (const auto& [ends, around] : edges)
    for (const std::size_t a : around)
      for (const std::size_t b : around) {
        const Eigen::Vector3d &one = elements[a].normal, &other = elements[b].normal;
        const double angle = std::atan2(one.cross(other).norm(), std::abs(one.dot(other)));
        if (angle > kFlat && angle < kEdge) straight.insert(a);
      }
  return std::ssize(straight);
}

}  // namespace varimesh::detail
