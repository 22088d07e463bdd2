// The maps of lower order on the cells of a mesh: their free nodes, and sums over the cells of each.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/problem/problem.h"
#include "core/ranks/halo.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// The continuous maps of one order on the cells of a problem, by their values at the optimised nodes of that order. A
/// node is free if it lies in a vertex, edge, face or cell whose nodes are free in the problem's own order. A *place*
/// is a node of a cell; places are numbered set by set, cell by cell, in the order of the cell's nodes.
struct OrderSpace {
  int order = 0;
  std::int32_t count = 0;  ///< Free nodes; d numbers each in all vectors.
  struct Set {             ///< One for each of Problem::sets.
    int nodes_per_cell = 0;
    std::int64_t first = 0;             ///< The set's first place.
    std::vector<std::int32_t> numbers;  ///< cells × nodes_per_cell: the number of the free node, −1 if it is fixed.
    std::vector<char> is_first;         ///< By place: 1 at the first one of each free node.
  };
  std::vector<Set> sets;
  /// count + 1: where each free node's places begin in `places`; empty in the problem's own order, whose incidences say
  /// the same.
  std::vector<std::int64_t> begin;
  std::vector<std::int64_t> places;  ///< In the order of the whole problem's cells for each node; or empty.
  std::int64_t place_count = 0;
  std::int32_t own_count = 0;  ///< So many free nodes at the beginning are this rank's own; without ranks, all.

  /// Of a part of a problem: how numbers go from rank to rank.
  struct Share {
    const Ranks* ranks = nullptr;  ///< Null without ranks. Then there is nothing to exchange.
    Halo values;                   ///< By node: from its owner to the ranks that work on one of its cells.
    Halo to_first, from_first;     ///< By node: from its owner to the rank that works on its first cell, and back.
    Halo contributions;            ///< By place: from the rank that works on the cell to the owner of the node.

    /// Exchanges `width` numbers for each item. All ranks call it together.
    void exchange(const Halo& halo, std::span<double> numbers, int width) const {
      if (ranks != nullptr) halo.exchange(numbers.data(), static_cast<std::size_t>(width), *ranks);
    }
  };
  Share share;
};

/// The space of the problem's own order; its free nodes are numbered as Problem::free. Call it inside team.run().
/// @param part  null, or what `problem` is the problem of. All ranks call it together then. A set's places go on after
/// the rank's own cells with its ghosts (problem_part.h). The cells of others give what they add to own nodes, and
/// Set::is_first says which place is first in the whole problem.
OrderSpace own_space(const Problem& problem, const Team& team, const ProblemPart* part = nullptr);

/// The space of a lower order. It does not depend on the number of threads. Call it inside team.run(). `part`: as
/// above. A node's owner is the owner of the problem's nodes in the same vertex, edge, face or cell.
OrderSpace lower_space(const Problem& problem, int order, const Team& team, const ProblemPart* part = nullptr);

/// Cells that matrices are applied to at the same time: the lanes of core/kernels/dense/lane_matrix.h. The sums do not
/// depend on it.
inline constexpr std::int32_t kCellsTogether = 8;

/// At which of its places gather() takes the value of a free node. At the others it takes 0.
enum class Occurrence : std::uint8_t { Every, First };

/// The values of a vector of the space at the nodes of cells `first` … `first` + `count` − 1 of a set, 0 at fixed
/// nodes: [node][direction][lane] with kCellsTogether lanes. Lanes beyond the cells keep what they have.
void gather(const OrderSpace::Set& set, Occurrence taken, std::int32_t first, std::int32_t count, int d,
            std::span<const double> vector, std::span<double> out);

/// out of an own node = Σ contributions at its places, in their order. `contributions` has d numbers per place; those
/// of other ranks' cells come from there.
void add_up(const Problem& problem, const OrderSpace& space, int d, std::span<double> contributions,
            std::span<double> out, const Team& team);

/// Calls body(set, first, count) for groups of at most kCellsTogether cells that make up all sets.
template <class Body>
void for_cells_together(const Problem& problem, const Team& team, const Body& body) {
  for (std::size_t set = 0; set < problem.sets.size(); ++set) {
    const std::int32_t cells = problem.sets[set].count;
    team.for_each((cells + kCellsTogether - 1) / kCellsTogether, 1, [&](std::int32_t group) {
      const std::int32_t first = group * kCellsTogether;
      body(set, first, std::min(kCellsTogether, cells - first));
    });
  }
}

}  // namespace varimesh
