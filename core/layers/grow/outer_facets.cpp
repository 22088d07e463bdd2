#include "core/layers/grow/outer_facets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <set>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// A facet is plane if its nodes are at most this share of its size off its plane.
constexpr double kPlane = 1e-6;

void find_normal(const HighOrderMesh& mesh, OuterFacet& facet) {
  const Vector from = point(mesh, facet.nodes[0]), a = point(mesh, facet.nodes[1]) - from;
  const bool is_line = facet.shape == Shape::Line;
  const Vector b = is_line ? Vector(0, 0, 1) : Vector(point(mesh, facet.nodes[2]) - from);
  const double size = std::max(a.norm(), is_line ? 0 : b.norm());
  facet.normal = a.cross(b).normalized();
  for (const std::int32_t node : facet.nodes)
    facet.is_plane = facet.is_plane && std::abs((point(mesh, node) - from).dot(facet.normal)) <= kPlane * size;
}

}  // namespace

std::vector<OuterFacet> outer_facets(const CheckedMesh& checked, std::span<const WallElement> walls) {
  const HighOrderMesh& mesh = checked.mesh;
  const Facets& facets = checked.facets;
  std::set<std::int32_t> wall_facets;
  for (const WallElement& wall : walls) wall_facets.insert(wall.facet);
  const Cells elements(mesh, mesh.dimension - 1), cells(mesh, mesh.dimension);
  std::map<std::int32_t, std::int32_t> element_of;  // by facet, if it has one
  for (const auto& [facet, element] : facets.elements) element_of[facet] = element;
  std::vector<OuterFacet> found;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::int32_t facet = facets.first[cell]; facet < facets.first[cell + 1]; ++facet) {
      const auto element = element_of.find(facet);
      const bool is_inside = facets.neighbour[at(facet)] >= 0;
      if (is_inside && (element == element_of.end() || facets.opposite[at(facet)] < facet)) continue;
      const int local = facet - facets.first[cell];
      OuterFacet outer;
      outer.shape = reference::info(cells.shape(cell)).facets[at(local)].shape;
      outer.vertices = reference::info(outer.shape).vertices;
      for (const int k : reference::facet_nodes(cells.shape(cell), mesh.order, local))
        outer.nodes.push_back(cells.nodes(cell)[at(k)]);
      outer.is_wall = wall_facets.contains(facet);
      if (element != element_of.end()) {
        outer.element = element->second;
        outer.entity = elements.range_of(at(element->second)).block->entity;
      }
      find_normal(mesh, outer);
      found.push_back(std::move(outer));
    }
  return found;
}

}  // namespace varimesh::detail
