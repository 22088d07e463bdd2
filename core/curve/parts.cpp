#include "core/curve/parts.h"

#include <algorithm>

#include "core/reference/nodes.h"

namespace varimesh::detail {

std::size_t MeshParts::HashVertices::operator()(const Vertices& v) const {
  std::uint64_t hash = 0;
  for (const std::int32_t x : v)
    hash = (hash ^ static_cast<std::uint32_t>(x)) * 0x9e3779b97f4a7c15u, hash ^= hash >> 29;
  return hash;
}

MeshParts::MeshParts(const HighOrderMesh& mesh, const std::vector<std::vector<int>>& surface_of_element) {
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    if (reference::info(block.shape).dimension != 2) continue;
    const auto stride = static_cast<std::ptrdiff_t>(reference::node_count(block.shape, block.order));
    for (std::ptrdiff_t e = 0; e < static_cast<std::ptrdiff_t>(block.size()); ++e)
      add_face(block.shape, block.order, {block.nodes.begin() + e * stride, block.nodes.begin() + (e + 1) * stride},
               true, surface_of_element[b][static_cast<std::size_t>(e)]);
  }
  for (const ElementBlock& block : mesh.blocks) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    if (info.dimension != 3) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t f = 0; f < info.faces.size(); ++f) {
        std::vector<std::int32_t> nodes;
        for (const int local : reference::facet_nodes(block.shape, block.order, static_cast<int>(f)))
          nodes.push_back(block.nodes[e * stride + static_cast<std::size_t>(local)]);
        add_face(info.faces[f].shape, block.order, std::move(nodes), false, -1);
      }
  }
}

void MeshParts::add_face(Shape shape, int order, std::vector<std::int32_t> nodes, bool on_surface, int surface) {
  Vertices key{-1, -1, -1, -1};
  std::copy_n(nodes.begin(), reference::info(shape).vertices, key.begin());
  std::ranges::sort(key);
  if (!known_.try_emplace(key, static_cast<std::int32_t>(faces.size())).second) return;
  MeshFace face{shape, std::move(nodes), on_surface, surface, {}};
  for (int facet = 0; facet < reference::info(shape).vertices; ++facet) {
    std::vector<std::int32_t> of_edge;
    for (const int local : reference::facet_nodes(shape, order, facet))
      of_edge.push_back(face.nodes[static_cast<std::size_t>(local)]);
    face.edges.push_back(edge(of_edge));
    if (!on_surface) continue;
    MeshEdge& own = edges[static_cast<std::size_t>(face.edges.back())];
    ++own.elements;
    const auto place = std::ranges::lower_bound(own.surfaces, surface);
    if (place == own.surfaces.end() || *place != surface) own.surfaces.insert(place, surface);
  }
  faces.push_back(std::move(face));
}

std::int32_t MeshParts::edge(const std::vector<std::int32_t>& nodes) {
  const auto [least, most] = std::minmax(nodes[0], nodes[1]);
  // No face has only two vertices, so edges share the table.
  const auto [at, is_new] = known_.try_emplace({-1, -1, least, most}, static_cast<std::int32_t>(edges.size()));
  if (!is_new) return at->second;
  MeshEdge made{{least, most}, {nodes.begin() + 2, nodes.end()}, {}, 0};
  if (nodes[0] != least) std::ranges::reverse(made.inner);
  edges.push_back(std::move(made));
  return at->second;
}

}  // namespace varimesh::detail
