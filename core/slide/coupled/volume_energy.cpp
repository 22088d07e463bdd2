#include "core/slide/coupled/volume_energy.h"

#include <algorithm>
#include <limits>

#include "core/base/index.h"
#include "core/base/reduction.h"
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
constexpr std::size_t kCellsPerTask = 4096;

/// The cells of order 1 on the vertices of a mesh's cells.
HighOrderMesh straight_cells(const HighOrderMesh& mesh, const Team& team) {
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
    const auto vertices = at(shape.vertices);
    cells.nodes.resize(block.size() * vertices);
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e)
        std::copy_n(block.nodes.data() + e * stride, vertices, cells.nodes.data() + e * vertices);
    });
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

}  // namespace

VolumeEnergy::VolumeEnergy(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team)
    : team_(team), frame_(frame_of(mesh, team)) {
  const Material material = varimesh::material(Options{});
  kernels_ = make_kernels(material, 3);
  hessian_ = make_hessian_kernels(material, 3);
  const HighOrderMesh straight = straight_cells(mesh, team);
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
  list_incidences(problem_, team);
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
  for (CellSet& set : problem_.sets) {
    set.delta_squared.resize(at(set.count));
    team_.for_ranges(at(set.count), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      std::fill_n(set.delta_squared.data() + begin, end - begin, delta * delta);
    });
  }
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
  const std::span<const CellScan> scans = cells_->scans();
  return -Reduction(team_).largest(
      scans.size(), kCellsPerTask, [&](std::size_t cell) { return -scans[cell].smallest_jacobian; },
      -std::numeric_limits<double>::infinity());
}

}  // namespace varimesh::detail
