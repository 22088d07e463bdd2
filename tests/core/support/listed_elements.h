// For tests of formats that are only read: the nodes of elements in an order that a test spells out, and the elements
// of a mesh by their numbers.
#pragma once

#include <array>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "core/formats/numbering/node_order.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"

namespace varimesh::testing {

/// Gmsh's local nodes of an element of order 2. Each word of `order` gives a node by the vertices whose mean it is:
/// "0", "01", "0123".
inline std::vector<int> nodes_between(Shape shape, const std::string& order) {
  const auto& lattice = reference::lattice(shape, 2);
  std::vector<int> nodes;
  std::istringstream words(order);
  for (std::string word; words >> word;) {
    std::array<int, 3> at{};
    for (const char vertex : word)
      for (std::size_t k = 0; k < 3; ++k) at[k] += lattice[std::size_t(vertex - '0')][k];
    for (int& x : at) x /= int(word.size());
    nodes.push_back(formats::nodes_by_position(shape, 2)[std::size_t(at[0] + 3 * (at[1] + 3 * at[2]))]);
  }
  return nodes;
}

/// The coordinates of the nodes of each element of this dimension, by its number.
inline std::map<std::int64_t, std::vector<double>> places_of(const HighOrderMesh& mesh, int dimension) {
  std::map<std::int64_t, std::vector<double>> all;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != dimension) continue;
    const std::size_t stride = nodes_per_element(block);
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t n = 0; n < stride; ++n)
        for (std::size_t k = 0; k < 3; ++k)
          all[block.numbers[e]].push_back(mesh.coordinates[3 * std::size_t(block.nodes[e * stride + n]) + k]);
  }
  return all;
}

/// The cells of a mesh, numbered from 1.
inline HighOrderMesh numbered_cells(HighOrderMesh mesh) {
  std::erase_if(mesh.blocks,
                [&](const ElementBlock& block) { return reference::info(block.shape).dimension != mesh.dimension; });
  std::int64_t number = 0;
  for (ElementBlock& block : mesh.blocks)
    for (std::int64_t& own : block.numbers) own = ++number;
  return mesh;
}

}  // namespace varimesh::testing
