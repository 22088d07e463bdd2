#include "core/curve/carry_over.h"

#include <algorithm>
#include <utility>

#include "core/base/index.h"

namespace varimesh::detail {

Association carry_over(const Association& start, const HighOrderMesh& mesh,
                       std::vector<std::vector<int>> surface_of_element, const std::vector<std::int32_t>& before) {
  Association now;
  now.geometry = start.geometry;
  now.factor = start.factor;
  now.size = start.size;
  now.in_plane = start.in_plane;
  now.matches = start.matches;
  now.repeated = start.repeated;
  now.surface_of_element = std::move(surface_of_element);
  now.nodes.assign(mesh.node_count(), {});
  now.surfaces.resize(start.surfaces.size());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const auto stride = static_cast<std::ptrdiff_t>(block.nodes.size() / std::max<std::size_t>(block.size(), 1));
    const std::vector<int>& surfaces = now.surface_of_element[b];
    for (std::size_t e = 0; e < surfaces.size(); ++e) {
      if (surfaces[e] < 0) continue;
      std::vector<std::int32_t>& own = now.surfaces[at(surfaces[e])].nodes;
      const auto first = block.nodes.begin() + static_cast<std::ptrdiff_t>(e) * stride;
      own.insert(own.end(), first, first + stride);
    }
  }
  for (std::size_t node = 0; node < before.size(); ++node)
    if (before[node] >= 0) now.nodes[node] = start.nodes[at(before[node])];
  for (std::size_t s = 0; s < now.surfaces.size(); ++s) {
    SurfaceNodes& own = now.surfaces[s];
    std::ranges::sort(own.nodes);
    const auto repeated = std::ranges::unique(own.nodes);
    own.nodes.erase(repeated.begin(), repeated.end());
    own.parameters.resize(own.nodes.size());
    SurfaceNodes known = start.surfaces[s];
    // A vertex that another, unmatched surface has too is not in the list; its edges there stay straight.
    for (std::size_t i = 0; i < own.nodes.size(); ++i)
      if (const std::int32_t old = before[at(own.nodes[i])]; old >= 0 && std::ranges::binary_search(known.nodes, old))
        own.parameters[i] = known.of(old);
  }
  return now;
}

}  // namespace varimesh::detail
