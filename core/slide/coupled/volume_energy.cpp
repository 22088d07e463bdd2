#include "core/slide/coupled/volume_energy.h"

#include <algorithm>
#include <limits>

#include "core/base/index.h"
#include "core/kernels/p_norm.h"
#include "core/options/options.h"
#include "core/problem/substitute_shapes.h"
#include "core/problem/targets.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "core/validity/certifier.h"

namespace varimesh::detail {
namespace {

/// The weight of the straight-sided cells.
constexpr double kStraightWeight = 0.05;
/// The weight of all points of the lattice together, beside 1 for those of the rule.
constexpr double kLatticeWeight = 0.05;

/// The cells of order 1 on the vertices of a mesh's cells.
HighOrderMesh straight_cells(const HighOrderMesh& mesh) {
  HighOrderMesh straight;
  straight.dimension = mesh.dimension;
  straight.order = 1;
  straight.coordinates = mesh.coordinates;
  for (const ElementBlock& block : mesh.blocks) {
    const reference::ShapeInfo& shape = reference::info(block.shape);
    if (shape.dimension != mesh.dimension) continue;
    ElementBlock cells;
    cells.shape = block.shape;
    cells.entity = block.entity;
    cells.numbers = block.numbers;
    const auto stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      cells.nodes.insert(cells.nodes.end(), block.nodes.begin() + static_cast<std::ptrdiff_t>(e * stride),
                         block.nodes.begin() + static_cast<std::ptrdiff_t>(e * stride) + shape.vertices);
    straight.blocks.push_back(std::move(cells));
  }
  return straight;
}

/// Replaces the table of the basis on the solver's nodes by that on the file's equispaced nodes. If the straight-sided
/// cells are affine, the points of the lattice join those of the quadrature rule, which has none at vertices and edges.
void use_file_nodes(CellSet& set) {
  const int d = set.dimension;
  const reference::Quadrature rule = reference::quadrature(set.shape, set.order, set.degree);
  reference::Points points = rule.points;
  if (set.affine) {
    const reference::Points lattice = reference::uniform_lattice(set.shape, set.order);
    points.resize(rule.points.rows() + lattice.rows(), d);
    points << rule.points, lattice;
    set.points = static_cast<int>(points.rows());
    set.stride = (set.points + kPointPadding - 1) / kPointPadding * kPointPadding;
    set.weights.resize(at(set.stride));
    std::fill(set.weights.begin() + rule.weights.size(), set.weights.end(), 0.0);
    std::fill_n(set.weights.begin() + rule.weights.size(), lattice.rows(),
                kLatticeWeight * rule.weights.sum() / static_cast<double>(lattice.rows()));
    set.derivatives.resize(at(set.nodes_per_cell * d * set.stride));
  }
  const auto gradients = reference::basis_gradients(set.shape, set.order, reference::NodeSet::Equispaced, d, points);
  for (int node = 0; node < set.nodes_per_cell; ++node)
    for (int k = 0; k < d; ++k)
      for (int q = 0; q < set.stride; ++q)
        set.derivatives[at((node * d + k) * set.stride + q)] = gradients[at(k)](std::min(q, set.points - 1), node);
}

/// Lists the incidences of the free nodes again, after sets were added.
void list_incidences(Problem& problem) {
  std::vector<std::int32_t> rank(problem.positions.size() / 3, -1);
  for (std::size_t f = 0; f < problem.free.size(); ++f) rank[at(problem.free[f])] = static_cast<std::int32_t>(f);
  problem.offsets.assign(problem.free.size() + 1, 0);
  const auto visit = [&](const auto& use) {
    for (std::size_t s = 0; s < problem.sets.size(); ++s)
      for (std::size_t n = 0; n < problem.sets[s].nodes.size(); ++n)
        if (const std::int32_t f = rank[at(problem.sets[s].nodes[n])]; f >= 0) {
          const auto per_cell = at(problem.sets[s].nodes_per_cell);
          use(at(f), Incidence{static_cast<std::int32_t>(n / per_cell), static_cast<std::int16_t>(s),
                               static_cast<std::int16_t>(n % per_cell)});
        }
  };
  visit([&](std::size_t f, const Incidence&) { ++problem.offsets[f + 1]; });
  for (std::size_t f = 0; f < problem.free.size(); ++f) problem.offsets[f + 1] += problem.offsets[f];
  problem.incidences.resize(at(problem.offsets.back()));
  std::vector<std::int64_t> next(problem.offsets.begin(), problem.offsets.end() - 1);
  visit([&](std::size_t f, const Incidence& incidence) { problem.incidences[at(next[f]++)] = incidence; });
}

}  // namespace

VolumeEnergy::VolumeEnergy(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team)
    : team_(team), frame_(frame_of(mesh, team)) {
  const Material material = varimesh::material(Options{});
  kernels_ = make_kernels(material, 3);
  hessian_ = make_hessian_kernels(material, 3);
  const HighOrderMesh straight = straight_cells(mesh);
  problem_ = build_problem(mesh, fixed, 0, team);
  Problem barrier = build_problem(straight, fixed, 0, team);
  const Certifier certifier(mesh, {}, team);
  const SubstituteShapes substitutes =
      substitute_shapes(mesh, facets(mesh, team), certifier.sound_with_straight_sides(mesh.coordinates, team), team);
  // The targets need only the vertices, which are the same nodes in both sets of nodes.
  problem_.positions = barrier.positions = solver_positions(straight, mesh.coordinates, frame_, team);
  for (Problem* part : {&problem_, &barrier}) set_targets(*part, {}, frame_.diagonal, substitutes, team);
  for (CellSet& set : problem_.sets) use_file_nodes(set);
  curved_sets_ = problem_.sets.size();
  for (CellSet& set : barrier.sets) {
    for (double& measure : set.measure) measure *= kStraightWeight;
    for (std::size_t i = 9; i < set.uniform_target.size(); i += 10) set.uniform_target[i] *= kStraightWeight;
    set.first += problem_.cells;
    problem_.sets.push_back(std::move(set));
  }
  problem_.cells += barrier.cells;
  list_incidences(problem_);
  cells_.emplace(problem_, *kernels_, *hessian_, PNorm{}, team);
}

std::vector<double> VolumeEnergy::volumes() const {
  std::vector<double> volumes(at(problem_.cells) / 2);
  for (std::size_t s = 0; s < curved_sets_; ++s)
    for (std::int32_t cell = 0; cell < problem_.sets[s].count; ++cell)
      volumes[at(problem_.sets[s].mesh_cell[at(cell)])] = cell_measure(problem_.sets[s], cell);
  return volumes;
}

void VolumeEnergy::set_delta(double delta) {
  for (CellSet& set : problem_.sets) set.delta_squared.assign(at(set.count), delta * delta);
}

void VolumeEnergy::place(std::span<const double> coordinates) {
  team_.for_ranges(coordinates.size() / 3, 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      for (std::size_t k = 0; k < 3; ++k)
        problem_.positions[3 * n + k] = (coordinates[3 * n + k] - frame_.centre[k]) / frame_.diagonal;
  });
}

double VolumeEnergy::energy(std::span<const double> coordinates) {
  place(coordinates);
  cells_->scan();
  return cells_->value();
}

double VolumeEnergy::least() const {
  double least = std::numeric_limits<double>::infinity();
  for (const CellScan& scan : cells_->scans()) least = std::min(least, scan.smallest_jacobian);
  return least;
}

}  // namespace varimesh::detail
