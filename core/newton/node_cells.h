// The cells of each node of a coarse space, and which nodes share a cell.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/newton/coarse_space.h"
#include "core/problem/problem.h"

namespace varimesh {

/// The cells of each node.
struct NodeCells {
  std::vector<std::int64_t> begin;    ///< nodes + 1: where each node's cells begin.
  std::vector<Incidence> incidences;  ///< By node, in the order of the cells.
};

NodeCells node_cells(const CoarseSpace& space, const Team& team);

/// The pattern of a symmetric matrix with a row and a column per node. An entry is there if the two nodes share a cell.
struct NodePattern {
  std::vector<std::int64_t> begin;   ///< nodes + 1: where each row begins.
  std::vector<std::int32_t> column;  ///< Ascending in a row.
};

/// `has_diagonal`: whether a node is in its own row.
NodePattern node_pattern(const CoarseSpace& space, const NodeCells& cells, bool has_diagonal, const Team& team);

}  // namespace varimesh
