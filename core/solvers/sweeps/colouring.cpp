#include "core/solvers/sweeps/colouring.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "core/base/shared_work.h"
#include "core/problem/clusters/first_fit.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 8192, kGroupsPerTask = 16;
constexpr std::int32_t kNodesPerChunk = 131'072, kGroupsPerChunk = 64;  // that are coloured together

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
  groups.begin = indices_where(team, nodes, kNodesPerTask, [&](std::size_t i) { return begins[i] != 0; });
  groups.begin.push_back(static_cast<std::int32_t>(nodes));
  return groups;
}

/// By place: the first cluster that it touches.
std::vector<std::int32_t> clusters_of(const Groups& places, const Problem& problem, const Team& team) {
  std::vector<std::int32_t> cluster_of(places.begin.size() - 1, problem.clusters);
  team.for_ranges(cluster_of.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t place = begin; place < end; ++place) {
      const std::int32_t node = places.nodes[places.begin[place]];
      for (std::int64_t i = problem.offsets[node]; i < problem.offsets[node + 1]; ++i) {
        const Incidence& at = problem.incidences[i];
        cluster_of[place] = std::min(cluster_of[place], problem.cluster[problem.sets[at.set].first + at.cell]);
      }
    }
  });
  return cluster_of;
}

/// The groups by place, joined by cluster.
Groups by_cluster(const Problem& problem, const Team& team) {
  const Groups places = by_place(problem, team);
  const std::vector<std::int32_t> cluster_of = clusters_of(places, problem, team);
  // The places and the nodes of each cluster, first how many, then where they begin.
  std::vector<std::int32_t> begin(problem.clusters + 1, 0), sizes(problem.clusters + 1, 0);
  const auto for_places = [&](const auto& body) {
    team.for_ranges(cluster_of.size(), kNodesPerTask, [&](std::size_t first, std::size_t last) {
      for (std::size_t place = first; place < last; ++place) body(static_cast<std::int32_t>(place), cluster_of[place]);
    });
  };
  for_places([&](std::int32_t, std::int32_t cluster) { count_up(begin[cluster], team); });
  std::vector<std::int32_t> listed(static_cast<std::size_t>(sums_before(begin))), next = begin;
  for_places([&](std::int32_t place, std::int32_t cluster) { listed[count_up(next[cluster], team)] = place; });
  team.for_each(problem.clusters, kGroupsPerTask, [&](std::int32_t cluster) {
    std::sort(listed.begin() + begin[cluster], listed.begin() + begin[cluster + 1]);
    for (std::int32_t i = begin[cluster]; i < begin[cluster + 1]; ++i)
      sizes[cluster] += places.begin[listed[i] + 1] - places.begin[listed[i]];
  });
  Groups groups;
  groups.nodes.resize(static_cast<std::size_t>(sums_before(sizes)));
  team.for_each(problem.clusters, kGroupsPerTask, [&](std::int32_t cluster) {
    std::int32_t* to = groups.nodes.data() + sizes[cluster];
    for (std::int32_t i = begin[cluster]; i < begin[cluster + 1]; ++i)
      to = std::copy(places.nodes.data() + places.begin[listed[i]], places.nodes.data() + places.begin[listed[i] + 1],
                     to);
  });
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

/// The groups that touch each cell.
struct GroupsAtCells {
  std::vector<std::int32_t> begin;  // cells + 1
  std::vector<std::int32_t> groups;

  GroupsAtCells(const std::vector<std::vector<std::int32_t>>& cells_of, std::int32_t cells, const Team& team)
      : begin(static_cast<std::size_t>(cells) + 1, 0) {
    const auto for_touched = [&](const auto& body) {
      team.for_ranges(cells_of.size(), kGroupsPerTask, [&](std::size_t first, std::size_t last) {
        for (std::size_t group = first; group < last; ++group)
          for (const std::int32_t cell : cells_of[group]) body(static_cast<std::int32_t>(group), cell);
      });
    };
    for_touched([&](std::int32_t, std::int32_t cell) { count_up(begin[cell], team); });
    groups.resize(static_cast<std::size_t>(sums_before(begin)));
    std::vector<std::int32_t> next = begin;
    for_touched([&](std::int32_t group, std::int32_t cell) { groups[count_up(next[cell], team)] = group; });
  }
};

/// The colour of each group. Groups are coloured `chunk` at a time.
std::vector<std::int32_t> colours_of(const Groups& groups, const Problem& problem, std::int32_t chunk,
                                     const Team& team) {
  const std::vector<std::vector<std::int32_t>> cells = cells_of(groups, problem, team);
  std::optional<GroupsAtCells> at_cells;  // one thread needs none
  if (team.threads() > 1) at_cells.emplace(cells, problem.cells, team);
  const auto for_cells_of = [&](std::int32_t group, const auto& use) {
    for (const std::int32_t cell : cells[group]) use(cell);
  };
  const auto for_groups_at = [&](std::int32_t cell, const auto& use) {
    for (std::int32_t i = at_cells->begin[cell]; i < at_cells->begin[cell + 1]; ++i) use(at_cells->groups[i]);
  };
  const FirstFitSizes sizes{static_cast<std::int32_t>(cells.size()), problem.cells, chunk};
  return first_fit(sizes, for_cells_of, for_groups_at, team);
}

}  // namespace

ColouredNodes colour_nodes(const Problem& problem, Colouring colouring, const Team& team) {
  const bool by_node = colouring == Colouring::Node;
  const Groups groups = by_node ? single_nodes(problem) : by_cluster(problem, team);
  const ColourPlaces places =
      sort_by_colour(colours_of(groups, problem, by_node ? kNodesPerChunk : kGroupsPerChunk, team), team);
  const std::size_t count = groups.begin.size() - 1;
  ColouredNodes coloured;
  coloured.colours = places.begin;
  coloured.groups.resize(count + 1, 0);
  const auto size_of = [&](std::size_t group) { return groups.begin[group + 1] - groups.begin[group]; };
  for (std::size_t group = 0; group < count; ++group)
    coloured.groups[static_cast<std::size_t>(places.place[group])] = size_of(group);
  sums_before(coloured.groups);
  coloured.nodes.resize(groups.nodes.size());
  team.for_ranges(count, by_node ? kNodesPerTask : kGroupsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t group = begin; group < end; ++group)
      std::copy_n(groups.nodes.data() + groups.begin[group], size_of(group),
                  coloured.nodes.data() + coloured.groups[static_cast<std::size_t>(places.place[group])]);
  });
  return coloured;
}

}  // namespace varimesh
