#include "core/preconditioner/multigrid/aggregation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "core/base/random/hash.h"

namespace varimesh::multigrid {
namespace {

constexpr double kLeastOthers = 0.1;  // over the diagonal entry

/// The strong connections as a graph, without those of rows that are led.
struct Graph {
  std::vector<std::int64_t> begin;
  std::vector<std::int32_t> neighbour;
};

Graph strong_graph(const Team& team, const LevelMatrix& matrix, const Strength& strength) {
  const std::size_t rows = at(matrix.rows);
  Graph graph;
  graph.begin.assign(rows + 1, 0);
  const auto for_strong = [&](std::size_t i, const auto& body) {
    if (strength.is_led(i)) return;
    for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e)
      if (strength.is_strong(i, at(matrix.column[at(e)]), matrix.value[at(e)])) body(matrix.column[at(e)]);
  };
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) for_strong(i, [&](std::int32_t) { ++graph.begin[i + 1]; });
  });
  for (std::size_t i = 0; i < rows; ++i) graph.begin[i + 1] += graph.begin[i];
  graph.neighbour.resize(at(graph.begin[rows]));
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      std::size_t to = at(graph.begin[i]);
      for_strong(i, [&](std::int32_t column) { graph.neighbour[to++] = column; });
    }
  });
  return graph;
}

/// A row's rank while roots are chosen. The state comes first, then the hash; the row number itself follows from the
/// hash, which is a permutation.
using Rank = std::uint64_t;
constexpr Rank kOut = 0, kUndecided = 1, kRoot = 2;
constexpr Rank rank_of(Rank state, std::uint32_t row) { return state << 32 | hash(row); }
constexpr Rank state_of(Rank rank) { return rank >> 32; }

/// True if the row and its neighbours are no longer undecided. Their ranks are then final.
bool is_decided_around(const Graph& graph, const std::vector<Rank>& rank, std::size_t row) {
  if (state_of(rank[row]) == kUndecided) return false;
  for (std::int64_t e = graph.begin[row]; e < graph.begin[row + 1]; ++e)
    if (state_of(rank[at(graph.neighbour[at(e)])]) == kUndecided) return false;
  return true;
}

/// The state of every row, once there are only roots and others.
std::vector<Rank> choose_roots(const Team& team, const Graph& graph, const Strength& strength) {
  const std::size_t rows = graph.begin.size() - 1;
  std::vector<Rank> rank(rows), near(rows);  // near: the highest rank within one connection
  std::vector<std::uint8_t> is_near_final(rows);
  for (std::size_t i = 0; i < rows; ++i)
    rank[i] = rank_of(strength.is_alone(i) || strength.is_led(i) ? kOut : kUndecided, static_cast<std::uint32_t>(i));
  const auto highest = [&graph](const std::vector<Rank>& of, std::size_t i) {
    Rank best = of[i];
    for (std::int64_t e = graph.begin[i]; e < graph.begin[i + 1]; ++e)
      best = std::max(best, of[at(graph.neighbour[at(e)])]);
    return best;
  };
  for (std::atomic<bool> is_done = false; !is_done;) {
    is_done = true;
    team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        if (is_near_final[i] == 0) near[i] = highest(rank, i);
    });
    team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        if (state_of(rank[i]) != kUndecided) continue;
        const Rank far = highest(near, i);
        if (far == rank[i])
          rank[i] = rank_of(kRoot, static_cast<std::uint32_t>(i));
        else if (state_of(far) == kRoot)
          rank[i] = rank_of(kOut, static_cast<std::uint32_t>(i));
        else
          is_done = false;
      }
    });
    team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        if (is_near_final[i] == 0) is_near_final[i] = is_decided_around(graph, rank, i) ? 1 : 0;
    });
  }
  return rank;
}

}  // namespace

Strength::Strength(const Team& team, const LevelMatrix& matrix, double threshold)
    : scale_(at(matrix.rows)), kind_(at(matrix.rows)) {
  team.for_ranges(at(matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double most = 0, sum = 0;
      for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e) {
        const double value = matrix.value[at(e)];
        most = std::max(most, -value);
        sum += std::abs(value);
      }
      const bool is_alone = most <= 0 || sum <= kLeastOthers * matrix.diagonal[i];
      scale_[i] = is_alone ? std::numeric_limits<float>::infinity() : static_cast<float>(std::sqrt(threshold * most));
      kind_[i] = is_alone ? kAlone : kMutual;
    }
  });
  team.for_ranges(at(matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      if (kind_[i] == kAlone) continue;
      bool has_strong = false;
      for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1] && !has_strong; ++e) {
        const float value = matrix.value[at(e)];
        has_strong = value < 0 && -value >= scale_[i] * scale_[at(matrix.column[at(e)])];
      }
      if (!has_strong) kind_[i] = kLed;
    }
  });
}

Aggregates aggregate(const Team& team, const LevelMatrix& matrix, const Strength& strength) {
  const std::size_t rows = at(matrix.rows);
  const Graph graph = strong_graph(team, matrix, strength);
  const std::vector<Rank> rank = choose_roots(team, graph, strength);
  Aggregates out;
  std::vector<std::int32_t> core(rows, -1);  // roots and their neighbours
  for (std::size_t i = 0; i < rows; ++i)
    if (state_of(rank[i]) == kRoot) core[i] = out.count++;
  const auto is_root = [&](std::int32_t row) { return state_of(rank[at(row)]) == kRoot; };
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      if (strength.is_alone(i) || state_of(rank[i]) == kRoot) continue;
      const auto begin = graph.neighbour.begin() + graph.begin[i], end = graph.neighbour.begin() + graph.begin[i + 1];
      const auto root = std::find_if(begin, end, is_root);  // one at most
      if (root != end) core[i] = core[at(*root)];
    }
  });
  out.of_row = core;
  team.for_ranges(rows, kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      if (strength.is_alone(i) || core[i] >= 0) continue;
      float best = 0;
      for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e) {
        const std::size_t other = at(matrix.column[at(e)]);
        if (core[other] >= 0 && -matrix.value[at(e)] > best && strength.is_strong(i, other, matrix.value[at(e)])) {
          best = -matrix.value[at(e)];
          out.of_row[i] = core[other];
        }
      }
    }
  });
  return out;
}

}  // namespace varimesh::multigrid
