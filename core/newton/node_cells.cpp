#include "core/newton/node_cells.h"

#include <algorithm>
#include <atomic>

#include "core/base/index.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 1024;

std::int64_t add_one(std::int64_t& count) {
  return std::atomic_ref<std::int64_t>(count).fetch_add(1, std::memory_order_relaxed);
}

/// Calls body(set, i) for entry i of each set's nodes that is not −1, from several threads at once.
template <class Body>
void for_nodes(const CoarseSpace& space, const Team& team, const Body& body) {
  for (std::size_t s = 0; s < space.sets.size(); ++s)
    team.for_ranges(space.sets[s].nodes.size(), kNodesPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        if (space.sets[s].nodes[i] >= 0) body(s, i);
    });
}

/// The nodes of one row, ascending.
void collect_row(const CoarseSpace& space, const NodeCells& cells, std::size_t node, bool has_diagonal,
                 std::vector<std::int32_t>& row) {
  row.clear();
  for (std::int64_t p = cells.begin[node]; p < cells.begin[node + 1]; ++p) {
    const Incidence& in = cells.incidences[at(p)];
    const CoarseSpace::Set& set = space.sets[at(in.set)];
    const std::int32_t* first = set.nodes.data() + at(in.cell) * at(set.nodes_per_cell);
    std::copy_if(first, first + set.nodes_per_cell, std::back_inserter(row),
                 [&](std::int32_t other) { return other >= 0 && (has_diagonal || at(other) != node); });
  }
  std::sort(row.begin(), row.end());
  row.erase(std::unique(row.begin(), row.end()), row.end());
}

}  // namespace

NodeCells node_cells(const CoarseSpace& space, const Team& team) {
  NodeCells out;
  const std::size_t nodes = at(space.count);
  out.begin.assign(nodes + 1, 0);
  for_nodes(space, team, [&](std::size_t s, std::size_t i) { add_one(out.begin[at(space.sets[s].nodes[i]) + 1]); });
  for (std::size_t node = 0; node < nodes; ++node) out.begin[node + 1] += out.begin[node];
  out.incidences.resize(at(out.begin[nodes]));
  std::vector<std::int64_t> next(out.begin.begin(), out.begin.end() - 1);
  for_nodes(space, team, [&](std::size_t s, std::size_t i) {
    const std::size_t per_cell = at(space.sets[s].nodes_per_cell);
    out.incidences[at(add_one(next[at(space.sets[s].nodes[i])]))] = {
        static_cast<std::int32_t>(i / per_cell), static_cast<std::int16_t>(s), static_cast<std::int16_t>(i % per_cell)};
  });
  const auto is_before = [](const Incidence& a, const Incidence& b) {
    return a.set != b.set ? a.set < b.set : a.cell < b.cell;
  };
  team.for_ranges(nodes, kNodesPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t node = first; node < last; ++node)
      std::sort(out.incidences.begin() + out.begin[node], out.incidences.begin() + out.begin[node + 1], is_before);
  });
  return out;
}

NodePattern node_pattern(const CoarseSpace& space, const NodeCells& cells, bool has_diagonal, const Team& team) {
  const std::size_t nodes = at(space.count), tasks = (nodes + kNodesPerTask - 1) / kNodesPerTask;
  NodePattern out;
  out.begin.assign(nodes + 1, 0);
  std::vector<std::vector<std::int32_t>> pieces(tasks);  // by task: its rows one after another
  team.for_ranges(tasks, 1, [&](std::size_t low, std::size_t high) {
    std::vector<std::int32_t> row;
    for (std::size_t task = low; task < high; ++task) {
      std::vector<std::int32_t> piece;
      for (std::size_t node = task * kNodesPerTask; node < std::min(nodes, (task + 1) * kNodesPerTask); ++node) {
        collect_row(space, cells, node, has_diagonal, row);
        out.begin[node + 1] = static_cast<std::int64_t>(row.size());
        piece.insert(piece.end(), row.begin(), row.end());
      }
      piece.shrink_to_fit();
      pieces[task] = std::move(piece);
    }
  });
  for (std::size_t node = 0; node < nodes; ++node) out.begin[node + 1] += out.begin[node];
  out.column.resize(at(out.begin[nodes]));
  team.for_ranges(tasks, 1, [&](std::size_t low, std::size_t high) {
    for (std::size_t task = low; task < high; ++task) {
      const std::vector<std::int32_t> piece = std::move(pieces[task]);
      std::copy(piece.begin(), piece.end(), out.column.begin() + out.begin[task * kNodesPerTask]);
    }
  });
  return out;
}

}  // namespace varimesh
