#include "core/mesh/changes/remove_nodes.h"

#include <algorithm>

namespace varimesh {

namespace {

void shorten(NodeBlock& block, const std::vector<bool>& keep, std::int32_t& next) {
  const std::size_t per_node = block.count > 0 ? block.parameters.size() / static_cast<std::size_t>(block.count) : 0;
  std::vector<double> parameters;
  const std::int32_t first = next;
  for (std::int32_t i = 0; i < block.count; ++i) {
    if (!keep[static_cast<std::size_t>(block.first + i)]) continue;
    ++next;
    const auto from = block.parameters.begin() + static_cast<std::ptrdiff_t>(per_node) * i;
    parameters.insert(parameters.end(), from, from + static_cast<std::ptrdiff_t>(per_node));
  }
  block.first = first;
  block.count = next - first;
  block.parameters = std::move(parameters);
}

}  // namespace

void remove_nodes(HighOrderMesh& mesh, const std::vector<bool>& keep) {
  std::vector<std::int32_t> place(mesh.node_count(), -1);
  std::int32_t next = 0;
  for (std::size_t node = 0; node < place.size(); ++node) {
    if (!keep[node]) continue;
    const auto to = static_cast<std::size_t>(next);
    for (std::size_t k = 0; k < 3; ++k) mesh.coordinates[3 * to + k] = mesh.coordinates[3 * node + k];
    mesh.node_numbers[to] = mesh.node_numbers[node];
    place[node] = next++;
  }
  mesh.coordinates.resize(3 * static_cast<std::size_t>(next));
  mesh.node_numbers.resize(static_cast<std::size_t>(next));
  next = 0;
  for (NodeBlock& block : mesh.node_blocks) shorten(block, keep, next);
  std::erase_if(mesh.node_blocks, [](const NodeBlock& block) { return block.count == 0; });
  for (ElementBlock& block : mesh.blocks)
    for (std::int32_t& node : block.nodes) node = place[static_cast<std::size_t>(node)];
  for (PeriodicLink& link : mesh.periodic) {
    for (auto& [node, master] : link.nodes) {
      node = place[static_cast<std::size_t>(node)];
      master = place[static_cast<std::size_t>(master)];
    }
    std::erase_if(link.nodes, [](const auto& pair) { return pair.first < 0 || pair.second < 0; });
  }
}

void drop_fields(HighOrderMesh& mesh) {
  std::erase_if(mesh.foreign, [](const ForeignSection& section) {
    return section.name == "NodeData" || section.name == "ElementData" || section.name == "ElementNodeData";
  });
}

}  // namespace varimesh
