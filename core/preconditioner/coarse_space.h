// A space of order 1 or 2 on the cells of the mesh: its nodes, how values at the mesh's nodes follow from them, and
// which of them share a cell.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Rows of (column, factor).
struct SparseRows {
  std::vector<std::int64_t> begin;  ///< rows + 1
  std::vector<std::int32_t> column;
  std::vector<float> factor;
};

/// Lagrange nodes of order 1 or 2, in the vertices, edges, faces and cells whose own nodes are free.
struct CoarseSpace {
  int order = 0;
  std::int32_t count = 0;  ///< Nodes; d unknowns each.
  struct Set {             ///< One for each of Problem::sets.
    int nodes_per_cell = 0;
    std::vector<std::int32_t> nodes;  ///< cells × nodes_per_cell; −1: fixed.
    /// nodes_per_cell × nodes_per_cell × d·d: means of ∂_k φ_a ∂_l φ_b over the reference cell, innermost (k, l).
    std::vector<float> stiffness;
    /// One row per node of the fine cell: its value is Σ factor · value of the cell's coarse node `column`. All cells
    /// of a node give it the same value.
    SparseRows values;
  };
  std::vector<Set> sets;
};

/// The space of this order, which is 1 or 2 and at most that of the mesh. Nodes are numbered in the order in
/// which they first occur in the cells. A vertex, edge, face or interior counts as free if its own mesh node
/// with the lowest number is free.
CoarseSpace coarse_space(const Problem& problem, int order, const Team& team);

/// By node of the space: the mesh node with the lowest number in its vertex, edge, face or interior, which is free.
std::vector<std::int32_t> lowest_mesh_nodes(const Problem& problem, const CoarseSpace& space);

/// Gives node i the number `number[i]`, a permutation.
void renumber(CoarseSpace& space, const std::vector<std::int32_t>& number, const Team& team);

/// The transpose of a matrix with this many columns.
SparseRows transposed(const SparseRows& rows, std::int32_t columns);

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
