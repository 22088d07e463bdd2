// The cells of a mesh, cut into batches of one shape and order that fit in cache. Internal to the library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// Consecutive cells of one block.
struct CellBatch {
  const ElementBlock* block = nullptr;
  std::size_t first = 0;  ///< The first cell's place among the block's elements.
  std::size_t count = 0;
  std::size_t cell = 0;  ///< The first cell's place among the mesh's cells (elements of dimension mesh.dimension).

  /// Node indices of the batch's i-th cell, in Gmsh's order.
  const std::int32_t* nodes(std::size_t i) const {
    return block->nodes.data() +
           (first + i) * static_cast<std::size_t>(reference::node_count(block->shape, block->order));
  }
};

/// All cells of the mesh, in its order, in batches of at most `size(block)` cells. The batches depend on the mesh only,
/// so results do not depend on the number of threads.
template <class Size>
std::vector<CellBatch> cell_batches(const HighOrderMesh& mesh, Size&& size) {
  std::vector<CellBatch> batches;
  std::size_t cell = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const std::size_t step = std::max<std::size_t>(1, size(block));
    for (std::size_t first = 0; first < block.size(); first += step) {
      const std::size_t count = std::min(step, block.size() - first);
      batches.push_back({&block, first, count, cell + first});
    }
    cell += block.size();
  }
  return batches;
}

/// The same with one batch per block.
inline std::vector<CellBatch> whole_blocks(const HighOrderMesh& mesh) {
  return cell_batches(mesh, [](const ElementBlock& block) { return block.size(); });
}

/// One table for each pair of shape and order that the mesh's cells have; `make(shape, order)` builds it.
template <class Table, class Make>
std::map<std::pair<Shape, int>, Table> tables_for_cells(const HighOrderMesh& mesh, Make&& make) {
  std::map<std::pair<Shape, int>, Table> tables;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    const std::pair key(block.shape, block.order);
    if (!tables.contains(key)) tables.emplace(key, make(block.shape, block.order));
  }
  return tables;
}

}  // namespace varimesh::detail
