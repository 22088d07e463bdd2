#include "core/solvers/sweeps/colouring.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <span>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 8192, kGroupsPerTask = 16;

/// The groups before colouring.
struct Groups {
  std::vector<std::int32_t> nodes;     // ranks in Problem::free, group by group
  std::vector<std::int32_t> begin{0};  // groups + 1: where each group's nodes begin in `nodes`
};

Groups single_nodes(const Problem& problem) {
  Groups groups;
  groups.nodes.resize(problem.free.size());
  std::iota(groups.nodes.begin(), groups.nodes.end(), 0);
  groups.begin.resize(problem.free.size() + 1);
  std::iota(groups.begin.begin(), groups.begin.end(), 0);
  return groups;
}

/// The turn of each local node in its cell: places in the order of their dimension and number, and the nodes of a place
/// in the order of their local numbers.
struct Turns {
  std::vector<std::int16_t> turn;   // by local node
  std::vector<std::int16_t> place;  // by local node: equal for the nodes of one place

  explicit Turns(const CellSet& set) : turn(set.nodes_per_cell), place(set.nodes_per_cell) {
    const auto& places = reference::node_places(set.shape, set.order);
    std::map<std::pair<int, int>, std::vector<int>> members;
    for (int i = 0; i < set.nodes_per_cell; ++i) members[{places[i].dimension, places[i].index}].push_back(i);
    std::int16_t turns = 0, number = 0;
    for (const auto& [key, locals] : members) {
      for (const int local : locals) {
        turn[local] = turns++;
        place[local] = number;
      }
      ++number;
    }
  }
};

/// Free nodes by the vertex, edge, face or interior that they lie in, in the order in which they first occur in the
/// cells.
///
/// Free nodes are numbered as they first occur, so those that first occur in one cell follow each other. They only have
/// to be sorted by place. A node's first incidence is that cell.
Groups by_place(const Problem& problem, const Team& team) {
  std::vector<Turns> turns;
  for (const CellSet& set : problem.sets) turns.emplace_back(set);
  const auto first = [&](std::int32_t f) -> const Incidence& { return problem.incidences[problem.offsets[f]]; };
  const auto same_cell = [&](std::int32_t f, std::int32_t g) {
    return first(f).set == first(g).set && first(f).cell == first(g).cell;
  };
  Groups groups;
  const std::size_t nodes = problem.free.size();
  groups.nodes.resize(nodes);
  std::vector<char> begins(nodes, 0);
  team.for_ranges(nodes, kNodesPerTask, [&](std::size_t from, std::size_t to) {
    std::size_t end = from;
    // The range before this one takes the rest of a cell that it has begun.
    while (end < to && end > 0 && same_cell(static_cast<std::int32_t>(end - 1), static_cast<std::int32_t>(end))) ++end;
    for (std::size_t begin = end; begin < to; begin = end) {
      while (end < nodes && same_cell(static_cast<std::int32_t>(begin), static_cast<std::int32_t>(end)))
        groups.nodes[end] = static_cast<std::int32_t>(end), ++end;
      const Turns& of_shape = turns[first(static_cast<std::int32_t>(begin)).set];
      std::sort(groups.nodes.begin() + begin, groups.nodes.begin() + end, [&](std::int32_t f, std::int32_t g) {
        return of_shape.turn[first(f).local] < of_shape.turn[first(g).local];
      });
      for (std::size_t i = begin; i < end; ++i)
        begins[i] = i == begin || of_shape.place[first(groups.nodes[i]).local] !=
                                      of_shape.place[first(groups.nodes[i - 1]).local]
                        ? 1
                        : 0;
    }
  });
  groups.begin.clear();
  for (std::size_t i = 0; i < nodes; ++i)
    if (begins[i] != 0) groups.begin.push_back(static_cast<std::int32_t>(i));
  groups.begin.push_back(static_cast<std::int32_t>(nodes));
  return groups;
}

/// The groups by place, joined by cluster: a place belongs to the first cluster that it touches.
Groups by_cluster(const Problem& problem, const Team& team) {
  const Groups places = by_place(problem, team);
  const std::size_t count = places.begin.size() - 1;
  std::vector<std::int32_t> cluster_of(count, problem.clusters);
  team.for_ranges(count, kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t place = begin; place < end; ++place) {
      const std::int32_t node = places.nodes[places.begin[place]];
      for (std::int64_t i = problem.offsets[node]; i < problem.offsets[node + 1]; ++i) {
        const Incidence& at = problem.incidences[i];
        cluster_of[place] = std::min(cluster_of[place], problem.cluster[problem.sets[at.set].first + at.cell]);
      }
    }
  });
  std::vector<std::int32_t> sizes(problem.clusters + 1, 0);
  for (std::size_t place = 0; place < count; ++place)
    sizes[cluster_of[place] + 1] += places.begin[place + 1] - places.begin[place];
  Groups groups;
  std::partial_sum(sizes.begin(), sizes.end(), sizes.begin());
  groups.nodes.resize(places.nodes.size());
  std::vector<std::int32_t> next(sizes.begin(), sizes.end() - 1);
  for (std::size_t place = 0; place < count; ++place)
    for (std::int32_t i = places.begin[place]; i < places.begin[place + 1]; ++i)
      groups.nodes[next[cluster_of[place]]++] = places.nodes[i];
  for (std::int32_t cluster = 0; cluster < problem.clusters; ++cluster)
    if (sizes[cluster + 1] > sizes[cluster]) groups.begin.push_back(sizes[cluster + 1]);
  return groups;
}

/// The cells that each group touches, in ascending order without repetition.
std::vector<std::vector<std::int32_t>> cells_of(const Groups& groups, const Problem& problem, const Team& team) {
  std::vector<std::vector<std::int32_t>> cells(groups.begin.size() - 1);
  const auto cell_of = [&](const Incidence& at) { return problem.sets[at.set].first + at.cell; };
  const auto list = [&](std::size_t group, std::vector<std::int32_t>& touched) {
    touched.clear();
    std::span<const Incidence> last;
    for (std::int32_t n = groups.begin[group]; n < groups.begin[group + 1]; ++n) {
      const std::int64_t begin = problem.offsets[groups.nodes[n]], end = problem.offsets[groups.nodes[n] + 1];
      const std::span incidences(problem.incidences.data() + begin, static_cast<std::size_t>(end - begin));
      // The nodes of one place have the same cells.
      if (!std::ranges::equal(incidences, last, {}, cell_of, cell_of))
        for (const Incidence& at : incidences) touched.push_back(cell_of(at));
      last = incidences;
    }
    std::sort(touched.begin(), touched.end());
    cells[group].assign(touched.begin(), std::unique(touched.begin(), touched.end()));
  };
  team.for_ranges(cells.size(), kGroupsPerTask, [&](std::size_t begin, std::size_t end) {
    std::vector<std::int32_t> touched;
    for (std::size_t group = begin; group < end; ++group) list(group, touched);
  });
  return cells;
}

}  // namespace

ColouredNodes colour_nodes(const Problem& problem, Colouring colouring, const Team& team) {
  const Groups groups = colouring == Colouring::Node ? single_nodes(problem) : by_cluster(problem, team);
  const std::vector<std::vector<std::int32_t>> cells = cells_of(groups, problem, team);
  ColouredNodes coloured;
  coloured.groups.push_back(0);
  coloured.colours.push_back(0);
  std::vector<std::int32_t> left(groups.begin.size() - 1);
  std::iota(left.begin(), left.end(), 0);
  std::vector<std::int32_t> struck_in(problem.cells, -1);  // by cell: the last colour that touched it
  std::vector<std::int32_t> struck_out;
  for (std::int32_t colour = 0; !left.empty(); ++colour) {
    struck_out.clear();
    for (const std::int32_t group : left) {
      const bool taken = std::any_of(cells[group].begin(), cells[group].end(),
                                     [&](std::int32_t cell) { return struck_in[cell] == colour; });
      if (taken) {
        struck_out.push_back(group);
        continue;
      }
      for (const std::int32_t cell : cells[group]) struck_in[cell] = colour;
      coloured.nodes.insert(coloured.nodes.end(), groups.nodes.begin() + groups.begin[group],
                            groups.nodes.begin() + groups.begin[group + 1]);
      coloured.groups.push_back(static_cast<std::int32_t>(coloured.nodes.size()));
    }
    coloured.colours.push_back(static_cast<std::int32_t>(coloured.groups.size() - 1));
    left.swap(struck_out);
  }
  return coloured;
}

}  // namespace varimesh
