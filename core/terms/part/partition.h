// Which rank works on which cells of a problem, and which free nodes it owns.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/index.h"
#include "core/base/reduction.h"
#include "core/problem/problem.h"

namespace varimesh {

/// A division of a problem's cells and free nodes among ranks. A rank gets whole blocks of Reduction::kBlock cells of a
/// set, and of as many free nodes, so that all ranks together add up the same sums of blocks as one rank.
struct Partition {
  int ranks = 1;
  std::vector<std::vector<std::int32_t>> cell_blocks;  ///< By set and block: the rank that works on these cells.
  std::vector<std::int32_t> node_blocks;               ///< By block of free nodes: the rank that owns them.

  std::int32_t rank_of_cell(std::size_t set, std::int32_t cell) const {
    return cell_blocks[set][at(cell) / Reduction::kBlock];
  }
  std::int32_t rank_of_node(std::int32_t free) const { return node_blocks[at(free) / Reduction::kBlock]; }
};

/// Gives each rank a range of the clusters with an equal share of the work, the quadrature points times the nodes of
/// the cells; a block of cells goes to the rank of its middle cell's cluster, and a block of nodes to the rank of the
/// first cell of its middle node. In a mesh of few cells, some ranks get none.
Partition partition(const Problem& problem, int ranks);

}  // namespace varimesh
