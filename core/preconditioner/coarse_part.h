// The part of a coarse space that one rank works on.
#pragma once

#include <cstdint>
#include <vector>

#include "core/preconditioner/coarse_space.h"
#include "core/ranks/halo.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// A coarse space on the cells of a ProblemPart, ghosts included, with nodes of its own numbering, in the order of the
/// whole space. A rank owns the nodes whose lowest mesh node (lowest_mesh_nodes()) it owns, so it has all their cells.
struct CoarsePart {
  CoarseSpace space;
  std::vector<std::int32_t> numbers;  ///< By node: the number in the whole space, ascending.
  std::vector<char> is_own;           ///< By node.
  NodeCells cells;                    ///< Of the own nodes, in the order of the whole problem's cells.
  std::vector<std::int32_t> colours;  ///< colours + 1: where each colour's nodes begin.
  Halo nodes;                         ///< Numbers by node.
  std::vector<Halo> by_colour;        ///< The same for the nodes of one colour.
  /// Numbers by coarse node of a cell, one array for each set, in the places of contribution_index() with width 1.
  Halo contributions;
};

/// `whole`: the space of the whole problem, whose numbers ascend with the colours; `colours`: where these begin.
CoarsePart coarse_part(const CoarseSpace& whole, const std::vector<std::int32_t>& colours, const ProblemPart& part);

/// By node of a space of the whole problem: the rank that owns it.
std::vector<std::int32_t> ranks_of_coarse_nodes(const CoarseSpace& whole, const ProblemPart& part);

/// The rows of these numbers.
SparseRows rows_of(const SparseRows& rows, const std::vector<std::int32_t>& numbers);

}  // namespace varimesh
