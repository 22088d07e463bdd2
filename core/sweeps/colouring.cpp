#include "core/sweeps/colouring.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh {
namespace {

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

/// Free nodes by the vertex, edge, face or interior that they lie in, in the order in which they first occur in the
/// cells.
Groups by_place(const Problem& problem) {
  std::vector<std::int32_t> rank;
  for (std::size_t f = 0; f < problem.free.size(); ++f) {
    rank.resize(std::max<std::size_t>(rank.size(), problem.free[f] + 1), -1);
    rank[problem.free[f]] = static_cast<std::int32_t>(f);
  }
  Groups groups;
  for (const CellSet& set : problem.sets) {
    const auto& places = reference::node_places(set.shape, set.order);
    // The local nodes of each place, to go through a cell place by place.
    std::map<std::pair<int, int>, std::vector<int>> members;
    for (int i = 0; i < set.nodes_per_cell; ++i) members[{places[i].dimension, places[i].index}].push_back(i);
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * set.nodes_per_cell;
      for (const auto& [place, locals] : members) {
        for (const int local : locals) {
          const std::size_t node = nodes[local];
          if (node >= rank.size() || rank[node] < 0) continue;
          groups.nodes.push_back(rank[node]);
          rank[node] = -1;
        }
        if (groups.begin.back() != static_cast<std::int32_t>(groups.nodes.size()))
          groups.begin.push_back(static_cast<std::int32_t>(groups.nodes.size()));
      }
    }
  }
  return groups;
}

/// The groups by place, joined by cluster: a place belongs to the first cluster that it touches.
Groups by_cluster(const Problem& problem) {
  const Groups places = by_place(problem);
  const std::size_t count = places.begin.size() - 1;
  std::vector<std::int32_t> cluster_of(count, problem.clusters);
  std::vector<std::int32_t> sizes(problem.clusters + 1, 0);
  for (std::size_t place = 0; place < count; ++place) {
    const std::int32_t node = places.nodes[places.begin[place]];
    for (std::int64_t i = problem.offsets[node]; i < problem.offsets[node + 1]; ++i) {
      const Incidence& at = problem.incidences[i];
      cluster_of[place] = std::min(cluster_of[place], problem.cluster[problem.sets[at.set].first + at.cell]);
    }
    sizes[cluster_of[place] + 1] += places.begin[place + 1] - places.begin[place];
  }
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
std::vector<std::vector<std::int32_t>> cells_of(const Groups& groups, const Problem& problem) {
  std::vector<std::vector<std::int32_t>> cells(groups.begin.size() - 1);
  for (std::size_t group = 0; group < cells.size(); ++group) {
    for (std::int32_t n = groups.begin[group]; n < groups.begin[group + 1]; ++n)
      for (std::int64_t i = problem.offsets[groups.nodes[n]]; i < problem.offsets[groups.nodes[n] + 1]; ++i)
        cells[group].push_back(problem.sets[problem.incidences[i].set].first + problem.incidences[i].cell);
    std::sort(cells[group].begin(), cells[group].end());
    cells[group].erase(std::unique(cells[group].begin(), cells[group].end()), cells[group].end());
  }
  return cells;
}

}  // namespace

ColouredNodes colour_nodes(const Problem& problem, Colouring colouring) {
  const Groups groups = colouring == Colouring::Node ? single_nodes(problem) : by_cluster(problem);
  const std::vector<std::vector<std::int32_t>> cells = cells_of(groups, problem);
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
