#include "core/mesh/changes/merge_nodes.h"

#include <numeric>
#include <vector>

#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/loose_parts.h"

namespace varimesh {

std::size_t merge_nodes(HighOrderMesh& mesh, double tolerance) {
  std::vector<bool> used(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    for (const std::int32_t node : block.nodes) used[static_cast<std::size_t>(node)] = true;
  std::vector<std::int32_t> nodes, to(mesh.node_count());
  std::iota(to.begin(), to.end(), 0);
  for (const std::int32_t node : to)
    if (used[static_cast<std::size_t>(node)]) nodes.push_back(node);
  const auto pairs = coincident_nodes(mesh, nodes, tolerance);
  std::vector<bool> keep(mesh.node_count(), true);
  for (const auto& [node, lower] : pairs) {
    to[static_cast<std::size_t>(node)] = to[static_cast<std::size_t>(lower)];  // `lower` has its own already
    keep[static_cast<std::size_t>(node)] = false;
  }
  for (ElementBlock& block : mesh.blocks)
    for (std::int32_t& node : block.nodes) node = to[static_cast<std::size_t>(node)];
  for (PeriodicLink& link : mesh.periodic)
    for (auto& [node, master] : link.nodes) {
      node = to[static_cast<std::size_t>(node)];
      master = to[static_cast<std::size_t>(master)];
    }
  remove_nodes(mesh, keep);
  return pairs.size();
}

}  // namespace varimesh
