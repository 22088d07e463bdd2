// The parameters of nodes on the curves and surfaces of a geometry, which MSH 4.1 may have. Internal to the library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Numbers per node: one on a curve, two on a surface, none elsewhere.
inline std::size_t parameters_per_node(int dimension) {
  return dimension == 1 || dimension == 2 ? static_cast<std::size_t>(dimension) : 0;
}

/// Whether the parameters of all nodes of the block are known.
inline bool has_parameters(const NodeBlock& block) {
  return !block.parameters.empty() &&
         block.parameters.size() == parameters_per_node(block.dimension) * static_cast<std::size_t>(block.count);
}

/// Remembers where the nodes with parameters are, so that the parameters of moved nodes can be forgotten. Without a
/// geometry nobody knows the new parameters.
class NodesWithParameters {
 public:
  explicit NodesWithParameters(const HighOrderMesh& mesh);
  /// Empties the parameters of each block in which a node has moved since. Blocks may have been added at the end.
  void forget_moved(HighOrderMesh& mesh) const;

 private:
  struct Block {
    std::int32_t first;
    std::vector<double> coordinates;
  };
  std::vector<Block> blocks_;  ///< By increasing `first`.
};

inline NodesWithParameters::NodesWithParameters(const HighOrderMesh& mesh) {
  for (const NodeBlock& block : mesh.node_blocks) {
    if (!has_parameters(block)) continue;
    const auto begin = mesh.coordinates.begin() + std::ptrdiff_t{3} * block.first;
    blocks_.push_back({block.first, {begin, begin + std::ptrdiff_t{3} * block.count}});
  }
}

inline void NodesWithParameters::forget_moved(HighOrderMesh& mesh) const {
  for (NodeBlock& block : mesh.node_blocks) {
    if (block.parameters.empty()) continue;
    const auto known = std::ranges::lower_bound(blocks_, block.first, {}, &Block::first);
    const bool stays = known != blocks_.end() && known->first == block.first && has_parameters(block) &&
                       std::equal(known->coordinates.begin(), known->coordinates.end(),
                                  mesh.coordinates.begin() + std::ptrdiff_t{3} * block.first);
    if (!stays) block.parameters = {};
  }
}

}  // namespace varimesh
