#include "core/curve/refined.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/base/index.h"
#include "core/curve/blend.h"
#include "core/curve/carry_over.h"
#include "core/curve/parts.h"
#include "core/curve/place.h"
#include "core/mesh/changes/simplex_blend.h"

namespace varimesh {
namespace {

using detail::MeshEdge;
using detail::MeshFace;
using detail::MeshParts;

/// The nodes between new vertices and others.
struct NewNodes {
  std::vector<bool> is_vertex;                         ///< By node: whether it is a new vertex.
  std::span<const std::array<std::int32_t, 2>> edges;  ///< Edges whose nodes are new, though their ends are not.
  std::vector<bool> is_new;                            ///< By node.
  std::vector<double> straight;  ///< The coordinates, straight-sided in all cells with a new vertex.
};

/// Whether a new vertex or both ends of a new edge are among the vertices for which has(vertex) is true.
template <class Vertices, class Has>
bool has_new(const NewNodes& found, const Vertices& vertices, const Has& has) {
  const auto among = [&](std::int32_t node) {
    for (std::size_t v = 0; v < vertices.size(); ++v)
      if (vertices[v] == node && has(v)) return true;
    return false;
  };
  for (std::size_t v = 0; v < vertices.size(); ++v)
    if (found.is_vertex[at(vertices[v])] && has(v)) return true;
  return std::ranges::any_of(found.edges, [&](const auto& edge) { return among(edge[0]) && among(edge[1]); });
}

/// Calls visit(shape, nodes) for each cell that has a new vertex or edge.
template <class Visit>
void for_each_part(const HighOrderMesh& mesh, const NewNodes& found, Visit&& visit) {
  for (const ElementBlock& block : mesh.blocks) {
    const auto& info = reference::info(block.shape);
    if (info.dimension != mesh.dimension) continue;
    const auto stride = at(reference::node_count(block.shape, mesh.order));
    for (std::size_t e = 0; e < block.size(); ++e) {
      const auto nodes = std::span(block.nodes).subspan(e * stride, stride);
      if (has_new(found, nodes.first(at(info.vertices)), [](std::size_t) { return true; })) visit(block.shape, nodes);
    }
  }
}

void find_new_nodes(const HighOrderMesh& mesh, NewNodes& found) {
  found.is_new = found.is_vertex;
  found.straight = mesh.coordinates;
  for_each_part(mesh, found, [&](Shape shape, std::span<const std::int32_t> nodes) {
    const Eigen::MatrixXd& linear = detail::simplex_blend(shape, mesh.order).linear;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const auto row = linear.row(static_cast<Eigen::Index>(n));
      for (std::size_t c = 0; c < 3; ++c) {
        double& to = found.straight[3 * at(nodes[n]) + c];
        to = 0;
        for (Eigen::Index v = 0; v < row.size(); ++v) to += row[v] * mesh.coordinates[3 * at(nodes[at(v)]) + c];
      }
      if (has_new(found, nodes.first(at(reference::info(shape).vertices)),
                  [&](std::size_t v) { return row[static_cast<Eigen::Index>(v)] > 0; }))
        found.is_new[at(nodes[n])] = true;
    }
  });
}

/// The split edges as they were, each with its new vertex as the only node between its ends.
MeshParts edges_that_were(const MeshParts& now, std::span<const NewVertex> vertices) {
  using Ends = std::array<std::int32_t, 2>;
  const auto sorted = [](std::int32_t a, std::int32_t b) { return Ends{std::min(a, b), std::max(a, b)}; };
  MeshParts parts;
  std::map<Ends, std::size_t> halves;  // one of each edge
  for (const NewVertex& vertex : vertices) {
    halves.emplace(sorted(vertex.ends[0], vertex.node), parts.edges.size());
    parts.edges.push_back({sorted(vertex.ends[0], vertex.ends[1]), {vertex.node}, {}, 0});
  }
  for (const MeshEdge& half : now.edges) {
    const auto found = halves.find(half.ends);
    if (found == halves.end()) continue;
    parts.edges[found->second].surfaces = half.surfaces;
    parts.edges[found->second].elements = half.elements;
  }
  return parts;
}

/// Puts new nodes but new vertices on the boundary where it is, and those inside where the others around lead them.
void place_new(HighOrderMesh& mesh, Association& association, const MeshParts& parts, const NewNodes& found,
               const std::vector<bool>& stays, const Team& team) {
  for (std::size_t node = 0; node < stays.size(); ++node)
    if (found.is_new[node] && !found.is_vertex[node])
      std::copy_n(&found.straight[3 * node], 3, &mesh.coordinates[3 * node]);
  detail::BoundaryPlacing(mesh, association, parts, team, {stays, found.straight}).run();
  for (const MeshFace& face : parts.faces) {
    const detail::InnerBlend& inside = detail::inner_blend(face.shape, mesh.order);
    if (!face.on_surface && !inside.inner.empty() && found.is_new[at(face.nodes[at(inside.inner[0])])])
      detail::move_inner(inside, face.nodes.data(), found.straight, mesh.coordinates);
  }
  for_each_part(mesh, found, [&](Shape shape, std::span<const std::int32_t> nodes) {
    if (mesh.dimension == 3)
      detail::move_inner(detail::inner_blend(shape, mesh.order), nodes.data(), found.straight, mesh.coordinates);
  });
}

}  // namespace

void place_refined(HighOrderMesh& mesh, Association& association, std::vector<std::vector<int>> surface_of_element,
                   std::span<const NewVertex> vertices, const Team& team) {
  const std::size_t had = association.nodes.size();
  NewNodes found;
  found.is_vertex.assign(mesh.node_count(), false);
  for (const NewVertex& vertex : vertices) found.is_vertex[at(vertex.node)] = true;
  find_new_nodes(mesh, found);
  std::vector<std::int32_t> before(mesh.node_count(), -1);
  std::vector<bool> stays(mesh.node_count());
  for (std::size_t node = 0; node < before.size(); ++node) {
    stays[node] = !found.is_new[node];
    if (node < had && stays[node]) before[node] = static_cast<std::int32_t>(node);
  }
  association = detail::carry_over(association, mesh, std::move(surface_of_element), before);
  const MeshParts parts(mesh, association.surface_of_element);
  const MeshParts old_edges = edges_that_were(parts, vertices);
  detail::BoundaryPlacing(mesh, association, old_edges, team, {stays, {}}).run();
  find_new_nodes(mesh, found);
  place_new(mesh, association, parts, found, stays, team);
}

void place_edges_anew(HighOrderMesh& mesh, Association& association, std::vector<std::vector<int>> surface_of_element,
                      const std::vector<std::int32_t>& before, std::span<const std::array<std::int32_t, 2>> edges,
                      const Team& team) {
  NewNodes found;
  found.is_vertex.assign(mesh.node_count(), false);
  found.edges = edges;
  find_new_nodes(mesh, found);
  std::vector<bool> stays(mesh.node_count());
  std::vector<std::int32_t> known = before;
  for (std::size_t node = 0; node < stays.size(); ++node) {
    stays[node] = !found.is_new[node];
    if (!stays[node]) known[node] = -1;
  }
  association = detail::carry_over(association, mesh, std::move(surface_of_element), known);
  const MeshParts parts(mesh, association.surface_of_element);
  place_new(mesh, association, parts, found, stays, team);
}

}  // namespace varimesh
