// Colours for items that touch cells, such as nodes, so that the threads can work on all items of a colour at the same
// time. The threads share the choice of the colours.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstdint>
#include <iterator>
#include <mutex>
#include <utility>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"

namespace varimesh {

/// Chunks of items in turns. Chunks of one round have no common cell.
struct Rounds {
  std::vector<std::int32_t> chunks;
  std::vector<std::int32_t> begin;  ///< rounds + 1: where each round begins in `chunks`.
};

/// All chunks in the order of their turns, which are at random but the same in every run.
std::vector<std::int32_t> chunks_in_turn(std::int32_t chunks);

/// The earliest rounds in which every chunk comes after all neighbours that have an earlier turn. `neighbours`: pairs
/// of chunks in any order, which may be there several times.
Rounds rounds_of(std::int32_t chunks, const std::vector<std::pair<std::int32_t, std::int32_t>>& neighbours);

/// Where items go that are sorted by colour and, within a colour, by their numbers.
struct ColourPlaces {
  std::vector<std::int32_t> place;  ///< By item.
  std::vector<std::int32_t> begin;  ///< colours + 1: the place of each colour's first item.
};

/// `colour_of`: by item; no colour below the highest is left out. Call it inside team.run().
ColourPlaces sort_by_colour(const std::vector<std::int32_t>& colour_of, const Team& team);

struct FirstFitSizes {
  std::int32_t items = 0, cells = 0;
  std::int32_t chunk = 1;  ///< Consecutive items that one thread colours.
};

namespace detail {

constexpr std::int32_t kFirstFitCellsPerTask = 1024;

/// The pairs of chunks that have a common cell, some of them several times.
template <class ItemsOf>
std::vector<std::pair<std::int32_t, std::int32_t>> neighbouring_chunks(const FirstFitSizes& sizes,
                                                                       const ItemsOf& for_items_of, const Team& team) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  std::mutex mutex;
  team.for_ranges(at(sizes.cells), kFirstFitCellsPerTask, [&](std::size_t begin, std::size_t end) {
    std::vector<std::pair<std::int32_t, std::int32_t>> mine;
    std::vector<std::int32_t> chunks;
    for (std::size_t cell = begin; cell < end; ++cell) {
      chunks.clear();
      for_items_of(static_cast<std::int32_t>(cell), [&](std::int32_t item) {
        if (std::ranges::find(chunks, item / sizes.chunk) == chunks.end()) chunks.push_back(item / sizes.chunk);
      });
      for (std::size_t i = 1; i < chunks.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) mine.emplace_back(chunks[i], chunks[j]);
    }
    std::ranges::sort(mine);
    const std::scoped_lock lock(mutex);
    std::ranges::unique_copy(mine, std::back_inserter(pairs));
  });
  return pairs;
}

}  // namespace detail

/// Gives each item the lowest colour that no item with a common cell has got before. Chunks take turns at random
/// (chunks_in_turn()), and items of a chunk come in the order of their numbers. Chunks without a common cell do not
/// depend on each other, so those of a round are coloured at the same time. This is the algorithm of M. Jones, P.
/// Plassmann, A parallel graph coloring heuristic, SIAM J. Sci. Comput. 14, 1993, with chunks in place of nodes. The
/// colours do not depend on the number of threads. Call it inside team.run().
///
/// @param for_cells_of for_cells_of(item, use) calls use(cell) for the cells that the item touches
/// @param for_items_of for_items_of(cell, use) calls use(item) for the items that touch the cell
/// @return the colour of each item
template <class CellsOf, class ItemsOf>
std::vector<std::int32_t> first_fit(const FirstFitSizes& sizes, const CellsOf& for_cells_of,
                                    const ItemsOf& for_items_of, const Team& team) {
  constexpr std::int32_t kColours = 64;  // that are chosen from at a time
  const auto chunks = static_cast<std::int32_t>(chunks_of(at(sizes.items), at(sizes.chunk)));
  Rounds rounds;
  if (team.threads() == 1)
    rounds = {chunks_in_turn(chunks), {0, chunks}};
  else
    rounds = rounds_of(chunks, detail::neighbouring_chunks(sizes, for_items_of, team));
  std::vector<std::int32_t> colour_of(at(sizes.items), -1);
  UntouchedVector<std::uint64_t> used(at(sizes.cells));  // by cell: a bit for each colour that an item there has
  std::atomic<bool> is_done{false};
  for (std::int32_t first = 0; !is_done; first += kColours) {
    is_done = true;
    team.for_ranges(used.size(), detail::kFirstFitCellsPerTask,
                    [&](std::size_t begin, std::size_t end) { std::fill_n(used.begin() + begin, end - begin, 0); });
    const auto colour = [&](std::int32_t item) {
      std::uint64_t around = 0;
      for_cells_of(item, [&](std::int32_t cell) { around |= used[at(cell)]; });
      const int lowest = std::countr_one(around);
      if (lowest == kColours) return is_done.store(false);
      colour_of[at(item)] = first + lowest;
      for_cells_of(item, [&](std::int32_t cell) { used[at(cell)] |= std::uint64_t{1} << lowest; });
    };
    for (std::size_t round = 0; round + 1 < rounds.begin.size(); ++round)
      team.for_each(rounds.begin[round + 1] - rounds.begin[round], 1, [&](std::int32_t i) {
        const std::int32_t begin = rounds.chunks[at(rounds.begin[round] + i)] * sizes.chunk;
        for (std::int32_t item = begin; item < std::min(sizes.items, begin + sizes.chunk); ++item)
          if (colour_of[at(item)] < 0) colour(item);
      });
  }
  return colour_of;
}

}  // namespace varimesh
