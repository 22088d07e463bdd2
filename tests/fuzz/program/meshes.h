// What must hold for every mesh that a reader has returned.
#pragma once

#include <algorithm>
#include <string>

#include "core/formats/formats.h"
#include "core/mesh/high_order_mesh.h"
#include "core/reference/serendipity.h"
#include "tests/fuzz/program/memory.h"

namespace varimesh::fuzz {

/// Ends the program if a number refers to something that the mesh does not have. `may_be_incomplete`: elements may be
/// serendipity elements, which complete_elements() has yet to complete.
inline void expect_whole(const HighOrderMesh& mesh, bool may_be_incomplete = false) {
  const auto nodes = static_cast<std::int64_t>(mesh.node_count());
  expect(mesh.coordinates.size() == 3 * mesh.node_count(), "the coordinates are no triples");
  expect(static_cast<std::int64_t>(mesh.node_numbers.size()) == nodes, "there are other numbers than nodes");
  const auto is_node = [&](std::int32_t node) { return node >= 0 && node < nodes; };
  for (const ElementBlock& block : mesh.blocks) {
    const auto per_element = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    const auto fewest = static_cast<std::size_t>(reference::serendipity_node_count(block.shape, block.order));
    expect(block.nodes.size() == block.size() * per_element ||
               (may_be_incomplete && fewest > 0 && block.nodes.size() == block.size() * fewest),
           "a block has too many or too few nodes");
    expect(std::all_of(block.nodes.begin(), block.nodes.end(), is_node), "an element's node does not exist");
    const std::size_t repeats = block.physical.empty() ? 0 : block.physical.size() - 1;
    expect(block.repeat_numbers.empty() || block.repeat_numbers.size() == repeats * block.size(),
           "a block has too many or too few numbers of repetitions");
  }
  std::int64_t covered = 0;
  for (const NodeBlock& block : mesh.node_blocks) {
    expect(block.first == covered && block.count >= 0, "the blocks of nodes do not follow each other");
    covered += block.count;
  }
  expect(covered == nodes, "the blocks of nodes do not cover the nodes");
  for (const PeriodicLink& link : mesh.periodic)
    for (const auto& [node, master] : link.nodes)
      expect(is_node(node) && is_node(master), "a periodic node does not exist");
}

/// What write() makes of a mesh; empty if it refuses.
template <class Write>
std::string written(const Write& write) {
  std::string bytes;
  const auto done = write([&](std::string_view piece) {
    bytes += piece;
    return true;
  });
  return done ? bytes : std::string();
}

}  // namespace varimesh::fuzz
