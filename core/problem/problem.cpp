#include "core/problem/problem.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <tuple>
#include <utility>

#include "core/base/io/large_arrays.h"
#include "core/base/shared_work.h"
#include "core/problem/clusters/clusters.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using reference::NodeSet;

constexpr std::size_t kClusterBytes = 256 << 10;
constexpr std::size_t kFewestClusters = 64;
constexpr std::size_t kCellsPerTask = 1024, kNodesPerTask = 16384;
constexpr std::int32_t kClustersPerTask = 16;

void fill_tables(CellSet& set, int degree) {
  const int d = set.dimension;
  const reference::Quadrature rule = reference::quadrature(set.shape, set.order, degree);
  const auto gradients = reference::basis_gradients(set.shape, set.order, NodeSet::Optimised, d, rule.points);
  set.points = static_cast<int>(rule.weights.size());
  set.stride = (set.points + kPointPadding - 1) / kPointPadding * kPointPadding;
  set.weights.assign(set.stride, 0.0);
  for (int q = 0; q < set.points; ++q) set.weights[q] = rule.weights[q];
  set.derivatives.resize(static_cast<std::size_t>(set.nodes_per_cell) * d * set.stride);
  for (int i = 0; i < set.nodes_per_cell; ++i)
    for (int k = 0; k < d; ++k)
      for (int q = 0; q < set.stride; ++q)
        set.derivatives[(static_cast<std::size_t>(i) * d + k) * set.stride + q] =
            gradients[k](std::min(q, set.points - 1), i);
}

/// Numbers the free nodes in the order in which they first occur in the cells. Returns for every node the number, −1 if
/// it is not free.
std::vector<std::int32_t> rank_free_nodes(Problem& problem, const std::vector<bool>& fixed, const Team& team) {
  constexpr std::int32_t kNoCell = std::numeric_limits<std::int32_t>::max();
  std::vector<std::int32_t> first_cell(fixed.size(), kNoCell);
  for (const CellSet& set : problem.sets)
    team.for_ranges(static_cast<std::size_t>(set.count), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin * set.nodes_per_cell; n < end * set.nodes_per_cell; ++n)
        lower_to(first_cell[set.nodes[n]], set.first + static_cast<std::int32_t>(n / set.nodes_per_cell), team);
    });
  // Calls use(node) for the free nodes that first occur in one of these cells, in order.
  const auto for_first = [&](const CellSet& set, std::size_t begin, std::size_t end, const auto& use) {
    for (std::size_t n = begin * set.nodes_per_cell; n < end * set.nodes_per_cell; ++n)
      if (const std::int32_t node = set.nodes[n];
          !fixed[node] && first_cell[node] == set.first + static_cast<std::int32_t>(n / set.nodes_per_cell))
        use(node);
  };
  std::vector<std::vector<std::size_t>> begins;  // by set and chunk: the number of its first free node
  std::size_t nodes = 0;
  for (const CellSet& set : problem.sets) {
    std::vector<std::size_t>& counts = begins.emplace_back(chunks_of(set.count, kCellsPerTask), 0);
    for_chunks(team, set.count, kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for_first(set, begin, end, [&](std::int32_t) { ++counts[chunk]; });
    });
    for (std::size_t& count : counts) nodes += std::exchange(count, nodes);
  }
  problem.free.resize(nodes);
  for (std::size_t b = 0; b < problem.sets.size(); ++b)
    for_chunks(team, problem.sets[b].count, kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      std::size_t next = begins[b][chunk];
      for_first(problem.sets[b], begin, end, [&](std::int32_t node) { problem.free[next++] = node; });
    });
  std::vector<std::int32_t> rank = std::move(first_cell);
  team.for_ranges(rank.size(), kNodesPerTask,
                  [&](std::size_t begin, std::size_t end) { std::fill_n(rank.begin() + begin, end - begin, -1); });
  team.for_ranges(nodes, kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) rank[problem.free[f]] = static_cast<std::int32_t>(f);
  });
  return rank;
}

/// The threads enter the incidences in any order, so those of a node are sorted afterwards.
///
/// @param rank by node: its place in problem.free; −1 if it is not free
void list_incidences(Problem& problem, const std::vector<std::int32_t>& rank, const Team& team) {
  // Calls use(rank, incidence) for all incidences of free nodes.
  const auto for_incidences = [&](const auto& use) {
    for (std::size_t b = 0; b < problem.sets.size(); ++b) {
      const CellSet& set = problem.sets[b];
      team.for_ranges(static_cast<std::size_t>(set.count), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
        const std::int32_t* node = set.nodes.data() + begin * set.nodes_per_cell;
        for (std::size_t cell = begin; cell < end; ++cell)
          for (int n = 0; n < set.nodes_per_cell; ++n)
            if (const std::int32_t f = rank[*node++]; f >= 0)
              use(f, Incidence{static_cast<std::int32_t>(cell), static_cast<std::int16_t>(b),
                               static_cast<std::int16_t>(n)});
      });
    }
  };
  problem.offsets.assign(problem.free.size() + 1, 0);
  for_incidences([&](std::int32_t f, const Incidence&) { count_up(problem.offsets[f], team); });
  problem.incidences.resize(sums_before(problem.offsets));
  std::vector<std::int64_t> fill = problem.offsets;
  for_incidences([&](std::int32_t f, const Incidence& at) { problem.incidences[count_up(fill[f], team)] = at; });
  if (team.threads() == 1) return;
  team.for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      std::sort(problem.incidences.begin() + problem.offsets[f], problem.incidences.begin() + problem.offsets[f + 1],
                [](const Incidence& a, const Incidence& b) {
                  return std::tie(a.set, a.cell, a.local) < std::tie(b.set, b.cell, b.local);
                });
  });
}

/// Adds a set for each shape, with the number of its cells but without the cells.
void add_sets(Problem& problem, const HighOrderMesh& mesh, int degree) {
  for (const ElementBlock& elements : mesh.blocks) {
    const reference::ShapeInfo& shape = reference::info(elements.shape);
    if (shape.dimension != mesh.dimension || elements.size() == 0) continue;
    auto set = std::find_if(problem.sets.begin(), problem.sets.end(),
                            [&](const CellSet& b) { return b.shape == elements.shape; });
    if (set == problem.sets.end()) {
      CellSet fresh;
      fresh.shape = elements.shape;
      fresh.dimension = mesh.dimension;
      fresh.order = mesh.order;
      fresh.nodes_per_cell = reference::node_count(elements.shape, mesh.order);
      fresh.affine = shape.affine;
      fresh.degree = degree;
      set = problem.sets.insert(problem.sets.end(), std::move(fresh));
    }
    set->count += static_cast<std::int32_t>(elements.size());
  }
  for (CellSet& set : problem.sets) {
    set.first = problem.cells;
    problem.cells += set.count;
    fill_tables(set, set.degree);
  }
}

/// The number of cells whose deformation gradients fit in the second-level cache; fewer if there would be too few
/// clusters to share among the threads.
std::int32_t cluster_size(const Problem& problem) {
  std::size_t bytes = 0;
  for (const CellSet& set : problem.sets)
    bytes += static_cast<std::size_t>(set.count) * set.dimension * set.dimension * set.stride * sizeof(double);
  const std::size_t cells = std::max(problem.cells, 1);
  return static_cast<std::int32_t>(std::clamp<std::size_t>(
      std::min(kClusterBytes * cells / std::max<std::size_t>(bytes, 1), cells / kFewestClusters), 1, 100000));
}

/// Sets CellSet::mesh_cell and the clusters. `set_of`: by cell of the mesh.
void share_out_cells(Problem& problem, const Clusters& clusters, const std::vector<std::int16_t>& set_of,
                     const Team& team) {
  const std::size_t sets = problem.sets.size();
  problem.clusters = static_cast<std::int32_t>(clusters.begin.size()) - 1;
  problem.cluster.resize(static_cast<std::size_t>(problem.cells));
  for (CellSet& set : problem.sets) set.mesh_cell.resize(static_cast<std::size_t>(set.count));
  // By cluster and set: how many cells, then where they begin in the set.
  std::vector<std::int32_t> next(static_cast<std::size_t>(problem.clusters) * sets, 0);
  const auto for_clusters = [&](const auto& body) {
    team.for_each(problem.clusters, kClustersPerTask, [&](std::int32_t cluster) {
      std::int32_t* of_cluster = next.data() + static_cast<std::size_t>(cluster) * sets;
      for (std::int32_t i = clusters.begin[cluster]; i < clusters.begin[cluster + 1]; ++i)
        body(cluster, clusters.cells[i], of_cluster);
    });
  };
  for_clusters([&](std::int32_t, std::int32_t cell, std::int32_t* counts) { ++counts[set_of[cell]]; });
  for (std::size_t s = 0; s < sets; ++s)
    for (std::int32_t sum = 0, cluster = 0; cluster < problem.clusters; ++cluster)
      sum += std::exchange(next[static_cast<std::size_t>(cluster) * sets + s], sum);
  for_clusters([&](std::int32_t cluster, std::int32_t cell, std::int32_t* places) {
    CellSet& set = problem.sets[set_of[cell]];
    const std::int32_t place = places[set_of[cell]]++;
    set.mesh_cell[place] = cell;
    problem.cluster[set.first + place] = cluster;
  });
}

void fill_sets(Problem& problem, const HighOrderMesh& mesh, const Clusters& clusters, const Team& team) {
  std::vector<const std::int32_t*> nodes(clusters.cells.size());  // by cell of the mesh
  std::vector<std::int16_t> set_of(clusters.cells.size());
  std::size_t first = 0;
  for (const ElementBlock& elements : mesh.blocks) {
    if (reference::info(elements.shape).dimension != mesh.dimension || elements.size() == 0) continue;
    const auto set = std::ranges::find(problem.sets, elements.shape, &CellSet::shape);
    team.for_ranges(elements.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        nodes[first + e] = elements.nodes.data() + e * static_cast<std::size_t>(set->nodes_per_cell);
        set_of[first + e] = static_cast<std::int16_t>(set - problem.sets.begin());
      }
    });
    first += elements.size();
  }
  share_out_cells(problem, clusters, set_of, team);
  for (CellSet& set : problem.sets) {
    set.nodes.resize(static_cast<std::size_t>(set.count) * set.nodes_per_cell);
    team.for_each(set.count, static_cast<std::int32_t>(kCellsPerTask), [&](std::int32_t cell) {
      std::copy_n(nodes[set.mesh_cell[cell]], set.nodes_per_cell,
                  set.nodes.begin() + static_cast<std::ptrdiff_t>(cell) * set.nodes_per_cell);
    });
    set.delta_squared.assign(set.count, 0.0);
  }
}

}  // namespace

bool holds_deformation(const Problem& problem) {
  return std::none_of(problem.sets.begin(), problem.sets.end(),
                      [](const CellSet& set) { return set.deformation.empty() && set.count > 0; });
}

bool hold_deformation(Problem& problem, bool keeps_function) {
  bool made = !holds_deformation(problem);
  for (CellSet& set : problem.sets) {
    const std::size_t numbers = keeps_function ? static_cast<std::size_t>(set.count) * set.stride : 0;
    made = made || set.jacobian_function.size() < numbers;
    resize_large(set.deformation, set.count * set.deformation_size());
    resize_large(set.jacobian_function, numbers);
  }
  return made;
}

void drop_deformation(Problem& problem) {
  for (CellSet& set : problem.sets) {
    UntouchedVector<double>().swap(set.deformation);
    UntouchedVector<double>().swap(set.jacobian_function);
  }
}

std::vector<double> free_positions(const Problem& problem, std::span<const double> positions, const Team& team) {
  const std::size_t d = problem.dimension;
  std::vector<double> free;
  resize_large(free, problem.free.size() * d);
  team.without_stop().for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) std::copy_n(&positions[problem.free[f] * d], d, &free[f * d]);
  });
  return free;
}

bool set_free_positions(const Problem& problem, const std::vector<double>& free, std::vector<double>& positions) {
  const std::size_t d = problem.dimension;
  if (free.size() != problem.free.size() * d) return false;
  for (std::size_t f = 0; f < problem.free.size(); ++f) std::copy_n(&free[f * d], d, &positions[problem.free[f] * d]);
  return true;
}

Problem build_problem(const HighOrderMesh& mesh, const std::vector<bool>& fixed, int quadrature_degree,
                      const Team& team) {
  assert(fixed.size() == mesh.node_count());
  Problem problem;
  problem.dimension = mesh.dimension;
  add_sets(problem, mesh, quadrature_degree > 0 ? quadrature_degree : 2 * mesh.order);
  const Clusters clusters = cluster_cells(mesh, cluster_size(problem), team);
  fill_sets(problem, mesh, clusters, team);
  list_incidences(problem, rank_free_nodes(problem, fixed, team), team);
  return problem;
}

void list_incidences(Problem& problem, const Team& team) {
  std::vector<std::int32_t> rank(problem.positions.size() / static_cast<std::size_t>(problem.dimension), -1);
  team.for_ranges(problem.free.size(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) rank[problem.free[f]] = static_cast<std::int32_t>(f);
  });
  list_incidences(problem, rank, team);
}

}  // namespace varimesh
