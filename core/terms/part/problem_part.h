// The part of a problem that one rank works on.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/problem/problem.h"
#include "core/ranks/halo.h"
#include "core/ranks/whole_reduction.h"
#include "core/terms/part/partition.h"

namespace varimesh {

/// What of a rank's Problem the rank owns, and how it comes by the rest.
struct ProblemShare {
  const Ranks* ranks = nullptr;
  std::int32_t own_nodes = 0;         ///< So many at the beginning of Problem::free are this rank's own.
  std::int64_t free_nodes = 0;        ///< Of the whole problem.
  std::vector<std::int32_t> numbers;  ///< By place in Problem::free: the place in that of the whole problem, ascending
                                      ///< among its own, and among the others.
  std::vector<std::int32_t> places;   ///< By set: the cells that its arrays have room for.
  Halo directions;                    ///< Numbers by place in Problem::free.
  Halo positions;                     ///< Numbers by node.
  /// Numbers by node of a cell, one array for each set, in the places of contribution_index() with width 1.
  Halo contributions;
  Halo cells;  ///< Numbers by place of a cell, one array for each set: the ghosts' come from the ranks that have them.
};

/// A problem as a rank sees it, with cells, nodes and free nodes of its own numbering.
///
/// The first CellSet::count cells of a set are those that the rank works on, in the order of the whole problem. The
/// arrays of a set go on after them, from the next multiple of kBatch, with the ghosts: cells of other ranks at nodes
/// that this rank owns. Problem::free has the nodes that the rank owns, in the order of the whole problem, and then the
/// nodes of its cells that other ranks own. `incidences` lists the cells of each own node, ghosts included, in the
/// order of the whole problem. So a sum over the cells of a node has the same terms in the same order with any number
/// of ranks.
struct ProblemPart {
  const Problem* whole = nullptr;  ///< What it is a part of. It must outlive the part.
  Partition partition;
  Problem problem;
  ProblemShare share;
  std::vector<std::int32_t> nodes;               ///< By node of `problem`: the node of the whole problem, ascending.
  std::vector<std::vector<std::int32_t>> cells;  ///< By set and place: the cell in the whole problem's set; −1: none.

  /// Takes the positions of the nodes and the δ of the cells from the whole problem again.
  void follow();
};

/// The part of this rank in partition(). The whole problem must be the same on all ranks.
ProblemPart part_of(const Problem& whole, const Ranks& ranks);

/// Sums over the terms of all ranks that have a part; with null, over those of this process.
inline WholeReduction whole_reduction(const Team& team, const ProblemPart* part) {
  return WholeReduction(team, part != nullptr ? *part->share.ranks : one_rank());
}

/// By node of a problem: its place in Problem::free; −1 if it is not free.
std::vector<std::int32_t> places_in_free(const Problem& problem);

/// Puts the positions of all own nodes of all ranks into those of the whole problem, on all ranks.
void gather_positions(const ProblemPart& part, std::vector<double>& whole);

/// The numbers of all free nodes of the whole problem, d for each, on all ranks. `mine`: those of the part's own free
/// nodes.
std::vector<double> gather_free(const ProblemPart& part, std::span<const double> mine);

/// The numbers of all cells of a set of the whole problem, `width` for each, on all ranks. `mine`: those of the part's
/// own cells, by place.
std::vector<float> gather_set(const ProblemPart& part, std::size_t set, std::span<const float> mine, std::size_t width);

/// Gives the part's cells of a set, ghosts included, their numbers out of those of all cells.
void take_of_set(const ProblemPart& part, std::size_t set, std::span<const float> whole, std::size_t width,
                 std::span<float> mine);

/// CellSet::first + cell of all cells of the whole problem, first those of the first rank, in the order of its part,
/// then those of the next.
std::vector<std::int32_t> cells_by_rank(const ProblemPart& part);

/// Puts numbers of the own cells of all ranks, by CellSet::first + cell of the part, to CellSet::first + cell of the
/// whole problem, on all ranks. `T` is plain data.
template <class T>
void gather_cells(const ProblemPart& part, std::span<const T> mine, std::span<T> whole) {
  const std::vector<T> all = part.share.ranks->gather_everywhere(std::vector<T>(mine.begin(), mine.end()));
  const std::vector<std::int32_t> numbers = cells_by_rank(part);
  for (std::size_t i = 0; i < all.size(); ++i) whole[at(numbers[i])] = all[i];
}

}  // namespace varimesh
