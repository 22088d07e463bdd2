#include "core/preconditioner/coarse_space.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using reference::NodePlace;
using reference::NodeSet;

constexpr std::int32_t kCellsPerTask = 1024;

/// For each node of the coarse cell, the local numbers of the fine nodes in the same vertex, edge, face or interior. No
/// two coarse nodes share one.
std::vector<std::vector<int>> fine_companions(Shape shape, int order, int fine_order) {
  const auto& fine = reference::node_places(shape, fine_order);
  std::vector<std::vector<int>> companions;
  for (const NodePlace& place : reference::node_places(shape, order)) {
    std::vector<int>& own = companions.emplace_back();
    for (std::size_t n = 0; n < fine.size(); ++n)
      if (fine[n].dimension == place.dimension && fine[n].index == place.index) own.push_back(static_cast<int>(n));
  }
  return companions;
}

/// Sets CoarseSpace::Set::nodes to keys, −1 for fixed nodes: the key of a coarse node is the lowest mesh node in its
/// vertex, edge, face or interior, whichever cell asks. Lowers `first` of each key to the first cell that has it.
void set_keys(const CellSet& cells, const std::vector<bool>& is_free, int order, const Team& team,
              CoarseSpace::Set& set, std::vector<std::int32_t>& first) {
  const std::vector<std::vector<int>> companions = fine_companions(cells.shape, order, cells.order);
  set.nodes.resize(at(cells.count) * at(set.nodes_per_cell));
  team.for_ranges(at(cells.count), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell) {
      const std::int32_t* nodes = cells.nodes.data() + cell * at(cells.nodes_per_cell);
      std::int32_t* keys = set.nodes.data() + cell * at(set.nodes_per_cell);
      for (std::size_t a = 0; a < companions.size(); ++a) {
        keys[a] = std::numeric_limits<std::int32_t>::max();
        for (const int n : companions[a]) keys[a] = std::min(keys[a], nodes[n]);
        if (is_free[at(keys[a])])
          lower_to(first[at(keys[a])], static_cast<std::int32_t>(at(cells.first) + cell), team);
        else
          keys[a] = -1;
      }
    }
  });
}

/// Replaces the keys by numbers in the order in which the keys first occur, and sets CoarseSpace::count.
void number_keys(const Problem& problem, const std::vector<std::int32_t>& first, const Team& team, CoarseSpace& space) {
  std::vector<std::int32_t> number(first.size());
  for (std::size_t s = 0; s < space.sets.size(); ++s) {
    const CoarseSpace::Set& set = space.sets[s];
    const std::size_t cells = at(problem.sets[s].count), tasks = (cells + kCellsPerTask - 1) / kCellsPerTask;
    const auto for_new = [&](std::size_t task, const auto& body) {
      for (std::size_t cell = task * kCellsPerTask; cell < std::min(cells, (task + 1) * kCellsPerTask); ++cell)
        for (std::size_t i = cell * at(set.nodes_per_cell); i < (cell + 1) * at(set.nodes_per_cell); ++i)
          if (set.nodes[i] >= 0 && at(first[at(set.nodes[i])]) == at(problem.sets[s].first) + cell) body(set.nodes[i]);
    };
    std::vector<std::int32_t> begin(tasks + 1, 0);
    team.for_ranges(tasks, 1, [&](std::size_t low, std::size_t high) {
      for (std::size_t task = low; task < high; ++task) for_new(task, [&](std::int32_t) { ++begin[task + 1]; });
    });
    begin[0] = space.count;
    for (std::size_t task = 0; task < tasks; ++task) begin[task + 1] += begin[task];
    team.for_ranges(tasks, 1, [&](std::size_t low, std::size_t high) {
      for (std::size_t task = low; task < high; ++task) {
        std::int32_t next = begin[task];
        for_new(task, [&](std::int32_t key) { number[at(key)] = next++; });
      }
    });
    space.count = begin[tasks];
  }
  renumber(space, number, team);
}

/// As CoarseSpace::Set::stiffness.
std::vector<float> mean_stiffness(Shape shape, int order, int d) {
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order);
  const auto gradients = reference::basis_gradients(shape, order, NodeSet::Equispaced, d, rule.points);
  const Eigen::Index nodes = gradients[0].cols();
  std::vector<float> stiffness;
  for (Eigen::Index a = 0; a < nodes; ++a)
    for (Eigen::Index b = 0; b < nodes; ++b)
      for (int k = 0; k < d; ++k)
        for (int l = 0; l < d; ++l)
          stiffness.push_back(static_cast<float>(
              (rule.weights.array() * gradients[k].col(a).array() * gradients[l].col(b).array()).sum() /
              rule.weights.sum()));
  return stiffness;
}

/// Values of the coarse cell's basis at the nodes of the fine cell.
SparseRows values_at_nodes(const CellSet& cells, int order) {
  const Eigen::MatrixXd values =
      reference::basis_values(cells.shape, order, NodeSet::Equispaced, cells.dimension,
                              reference::nodes(cells.shape, cells.order, NodeSet::Optimised, cells.dimension));
  SparseRows rows;
  rows.begin.push_back(0);
  for (Eigen::Index n = 0; n < values.rows(); ++n) {
    for (Eigen::Index a = 0; a < values.cols(); ++a)
      if (std::abs(values(n, a)) >= 1e-12) {
        rows.column.push_back(static_cast<std::int32_t>(a));
        rows.factor.push_back(static_cast<float>(values(n, a)));
      }
    rows.begin.push_back(static_cast<std::int64_t>(rows.column.size()));
  }
  return rows;
}

constexpr std::size_t kNodesPerTask = 1024;

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

SparseRows transposed(const SparseRows& rows, std::int32_t columns) {
  SparseRows out;
  out.begin.assign(columns + 1, 0);
  for (const std::int32_t column : rows.column) ++out.begin[column + 1];
  for (std::int32_t c = 0; c < columns; ++c) out.begin[c + 1] += out.begin[c];
  out.column.resize(rows.column.size());
  out.factor.resize(rows.factor.size());
  std::vector<std::int64_t> next(out.begin.begin(), out.begin.end() - 1);
  for (std::size_t row = 0; row + 1 < rows.begin.size(); ++row)
    for (std::int64_t i = rows.begin[row]; i < rows.begin[row + 1]; ++i) {
      const std::int64_t at = next[rows.column[i]]++;
      out.column[at] = static_cast<std::int32_t>(row);
      out.factor[at] = rows.factor[i];
    }
  return out;
}

CoarseSpace coarse_space(const Problem& problem, int order, const Team& team) {
  CoarseSpace space;
  space.order = order;
  const std::size_t nodes = problem.positions.size() / at(problem.dimension);
  std::vector<bool> is_free(nodes, false);
  for (const std::int32_t node : problem.free) is_free[at(node)] = true;
  std::vector<std::int32_t> first(nodes, std::numeric_limits<std::int32_t>::max());  // by key: the first of its cells
  for (const CellSet& cells : problem.sets) {
    CoarseSpace::Set& set = space.sets.emplace_back();
    set.nodes_per_cell = reference::node_count(cells.shape, order);
    set.stiffness = mean_stiffness(cells.shape, order, problem.dimension);
    set.values = values_at_nodes(cells, order);
    set_keys(cells, is_free, order, team, set, first);
  }
  number_keys(problem, first, team, space);
  return space;
}

std::vector<std::int32_t> lowest_mesh_nodes(const Problem& problem, const CoarseSpace& space) {
  std::vector<std::int32_t> lowest(at(space.count), std::numeric_limits<std::int32_t>::max());
  for (std::size_t s = 0; s < space.sets.size(); ++s) {
    const CellSet& cells = problem.sets[s];
    const std::vector<std::vector<int>> companions = fine_companions(cells.shape, space.order, cells.order);
    for (std::size_t i = 0; i < space.sets[s].nodes.size(); ++i) {
      if (space.sets[s].nodes[i] < 0) continue;
      const std::int32_t* nodes = cells.nodes.data() + i / companions.size() * at(cells.nodes_per_cell);
      std::int32_t& of_node = lowest[at(space.sets[s].nodes[i])];
      for (const int n : companions[i % companions.size()]) of_node = std::min(of_node, nodes[n]);
    }
  }
  return lowest;
}

void renumber(CoarseSpace& space, const std::vector<std::int32_t>& number, const Team& team) {
  for (CoarseSpace::Set& set : space.sets)
    team.for_ranges(set.nodes.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        if (set.nodes[i] >= 0) set.nodes[i] = number[at(set.nodes[i])];
    });
}

NodeCells node_cells(const CoarseSpace& space, const Team& team) {
  NodeCells out;
  const std::size_t nodes = at(space.count);
  out.begin.assign(nodes + 1, 0);
  for_nodes(space, team, [&](std::size_t s, std::size_t i) { count_up(out.begin[at(space.sets[s].nodes[i])], team); });
  out.incidences.resize(at(sums_before(out.begin)));
  std::vector<std::int64_t> next = out.begin;
  for_nodes(space, team, [&](std::size_t s, std::size_t i) {
    const std::size_t per_cell = at(space.sets[s].nodes_per_cell);
    out.incidences[at(count_up(next[at(space.sets[s].nodes[i])], team))] = {
        static_cast<std::int32_t>(i / per_cell), static_cast<std::int16_t>(s), static_cast<std::int16_t>(i % per_cell)};
  });
  const auto is_before = [](const Incidence& a, const Incidence& b) {
    return a.set != b.set ? a.set < b.set : a.cell < b.cell;
  };
  if (team.threads() == 1) return out;
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
