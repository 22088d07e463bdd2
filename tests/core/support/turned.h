// Cells that are numbered clockwise, for tests.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "core/validity/orientation.h"

namespace varimesh::testing {

/// By cell: 1 if `chosen(cell)`.
inline std::vector<char> cells_that(const HighOrderMesh& mesh, const std::function<bool(std::size_t)>& chosen) {
  std::vector<char> which(mesh.element_count(mesh.dimension));
  for (std::size_t cell = 0; cell < which.size(); ++cell) which[cell] = chosen(cell) ? 1 : 0;
  return which;
}

inline bool every_cell(std::size_t) { return true; }
inline bool every_third_cell(std::size_t cell) { return cell % 3 == 1; }

/// The mesh with these cells turned over.
inline HighOrderMesh turned(HighOrderMesh mesh, const std::function<bool(std::size_t)>& chosen) {
  const std::vector<char> which = cells_that(mesh, chosen);
  detail::turn_cells(mesh, which);
  return mesh;
}

/// The nodes of all elements, block after block.
inline std::vector<std::vector<std::int32_t>> nodes_of_blocks(const HighOrderMesh& mesh) {
  std::vector<std::vector<std::int32_t>> nodes;
  for (const ElementBlock& block : mesh.blocks) nodes.push_back(block.nodes);
  return nodes;
}

}  // namespace varimesh::testing
