// The nodes of simplices by the vertices that they lie between, so that cells find the nodes that they share. Internal
// to the library.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh {

/// A node by the vertices that it lies between, in ascending order, and its weight on each of them. The weights add up
/// to the order P.
using NodeKey = std::array<std::pair<std::int32_t, std::int32_t>, 4>;

inline constexpr std::pair<std::int32_t, std::int32_t> kNobody{-1, 0};

/// The indices of a simplex's vertices; −1 where it has fewer than four.
using VertexNodes = std::array<std::int32_t, 4>;

inline VertexNodes vertex_nodes(Shape shape, const std::int32_t* nodes) {
  VertexNodes result{-1, -1, -1, -1};
  std::copy_n(nodes, reference::info(shape).vertices, result.begin());
  return result;
}

/// Of each node, its weight on each vertex.
using NodeWeights = std::vector<std::array<std::int32_t, 4>>;

/// Those of a simplex, in Gmsh's node order.
inline NodeWeights node_weights(Shape shape, int order) {
  NodeWeights result;
  for (const auto& position : reference::lattice(shape, order))
    result.push_back({order - position[0] - position[1] - position[2], position[0], position[1], position[2]});
  return result;
}

inline NodeKey node_key(const VertexNodes& vertices, const std::array<std::int32_t, 4>& weights) {
  NodeKey result;
  for (std::size_t v = 0; v < 4; ++v) result[v] = weights[v] > 0 ? std::pair{vertices[v], weights[v]} : kNobody;
  std::ranges::sort(result);
  return result;
}

}  // namespace varimesh
