#include "core/problem/problem.h"

#include <algorithm>
#include <cassert>

#include "core/problem/clusters.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using reference::NodeSet;

constexpr std::size_t kClusterBytes = 256 << 10;
constexpr std::size_t kFewestClusters = 64;

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

void list_incidences(Problem& problem, const std::vector<bool>& fixed) {
  std::vector<std::int32_t> rank(fixed.size(), -1);
  std::vector<std::int32_t> degree(fixed.size(), 0);
  for (const CellSet& set : problem.sets)
    for (const std::int32_t node : set.nodes) ++degree[node];
  for (const CellSet& set : problem.sets)
    for (const std::int32_t node : set.nodes) {
      if (fixed[node] || rank[node] >= 0) continue;
      rank[node] = static_cast<std::int32_t>(problem.free.size());
      problem.free.push_back(node);
    }
  problem.offsets.assign(problem.free.size() + 1, 0);
  for (std::size_t f = 0; f < problem.free.size(); ++f)
    problem.offsets[f + 1] = problem.offsets[f] + degree[problem.free[f]];
  problem.incidences.resize(problem.offsets.back());
  std::vector<std::int64_t> fill(problem.offsets.begin(), problem.offsets.end() - 1);
  for (std::size_t b = 0; b < problem.sets.size(); ++b) {
    const CellSet& set = problem.sets[b];
    for (std::size_t n = 0; n < set.nodes.size(); ++n) {
      const std::int32_t f = rank[set.nodes[n]];
      if (f < 0) continue;
      problem.incidences[fill[f]++] = {static_cast<std::int32_t>(n / set.nodes_per_cell), static_cast<std::int16_t>(b),
                                       static_cast<std::int16_t>(n % set.nodes_per_cell)};
    }
  }
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

void fill_sets(Problem& problem, const HighOrderMesh& mesh, const Clusters& clusters) {
  std::vector<const std::int32_t*> nodes;
  std::vector<CellSet*> sets;
  for (const ElementBlock& elements : mesh.blocks) {
    if (reference::info(elements.shape).dimension != mesh.dimension) continue;
    for (CellSet& set : problem.sets)
      for (std::size_t e = 0; set.shape == elements.shape && e < elements.size(); ++e) {
        nodes.push_back(elements.nodes.data() + e * static_cast<std::size_t>(set.nodes_per_cell));
        sets.push_back(&set);
      }
  }
  problem.cluster.resize(problem.cells);
  problem.clusters = static_cast<std::int32_t>(clusters.begin.size()) - 1;
  for (std::int32_t cluster = 0; cluster < problem.clusters; ++cluster)
    for (std::int32_t i = clusters.begin[cluster]; i < clusters.begin[cluster + 1]; ++i) {
      const std::int32_t cell = clusters.cells[i];
      CellSet& set = *sets[cell];
      problem.cluster[set.first + static_cast<std::int32_t>(set.mesh_cell.size())] = cluster;
      set.mesh_cell.push_back(cell);
      set.nodes.insert(set.nodes.end(), nodes[cell], nodes[cell] + set.nodes_per_cell);
    }
  for (CellSet& set : problem.sets) set.delta_squared.assign(set.count, 0.0);
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
    set.deformation.resize(set.count * set.deformation_size());
    set.jacobian_function.resize(numbers);
  }
  return made;
}

void drop_deformation(Problem& problem) {
  for (CellSet& set : problem.sets) {
    AlignedVector<double>().swap(set.deformation);
    AlignedVector<double>().swap(set.jacobian_function);
  }
}

std::vector<double> free_positions(const Problem& problem, const std::vector<double>& positions) {
  const std::size_t d = problem.dimension;
  std::vector<double> free(problem.free.size() * d);
  for (std::size_t f = 0; f < problem.free.size(); ++f) std::copy_n(&positions[problem.free[f] * d], d, &free[f * d]);
  return free;
}

bool set_free_positions(const Problem& problem, const std::vector<double>& free, std::vector<double>& positions) {
  const std::size_t d = problem.dimension;
  if (free.size() != problem.free.size() * d) return false;
  for (std::size_t f = 0; f < problem.free.size(); ++f) std::copy_n(&free[f * d], d, &positions[problem.free[f] * d]);
  return true;
}

Problem build_problem(const HighOrderMesh& mesh, const std::vector<bool>& fixed, int quadrature_degree) {
  assert(fixed.size() == mesh.node_count());
  Problem problem;
  problem.dimension = mesh.dimension;
  add_sets(problem, mesh, quadrature_degree > 0 ? quadrature_degree : 2 * mesh.order);
  const Clusters clusters = cluster_cells(mesh, cluster_size(problem));
  fill_sets(problem, mesh, clusters);
  list_incidences(problem, fixed);
  return problem;
}

}  // namespace varimesh
