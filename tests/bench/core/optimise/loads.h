// The two kernels in which an optimisation spends its time, ready to be measured: a sweep, and a product with the
// Hessian.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"
#include "core/solvers/sweeps/colouring.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/support/problems.h"

namespace varimesh::bench {

/// Flops per quadrature point when a sweep visits a node: expansion, one trial of the line search, and the move.
constexpr double flops_per_point(int dimension) { return dimension == 3 ? 270 : 165; }

/// How many quadrature points one sweep over every free node visits, summed over the nodes and their cells.
inline double points_visited(const Problem& problem) {
  double points = 0;
  for (const Incidence& at : problem.incidences) points += problem.sets[at.set].points;
  return points;
}

/// Flops of a product in one cell: the gradient of the direction at every point and its transpose, both folded by the
/// cell's mirror symmetries, and about 240 (3-D) or 80 (2-D) flops per point between them. This is 28 kflop for a
/// tetrahedron of order 4; with the gradient as a plain table it would be 69.
inline double product_flops(const BatchSet& block) {
  const int d = block.cells->dimension;
  const auto signs = [](const std::vector<FoldedGradient::Orbit>& orbits) {
    double additions = 0;
    for (const FoldedGradient::Orbit& orbit : orbits) additions += orbit.mirrors * (1 << orbit.mirrors);
    return additions;
  };
  double flops = block.cells->points * (d == 3 ? 240 : 80);
  for (const FoldedGradient::Parity& parity : block.gradient.parities)
    flops += 4.0 * d * double(parity.backward.size());
  return flops + 2 * d * signs(block.gradient.node_orbits) + 2 * d * d * signs(block.gradient.point_orbits);
}

/// Sweeps on one thread, which can be repeated from the initial mesh.
class SweepLoad {
 public:
  SweepLoad(const HighOrderMesh& mesh, const Options& options)
      : problem_(testing::make_problem(mesh)),
        start_(problem_.positions),
        coloured_(colour_nodes(problem_, options.colouring)),
        kernels_(make_kernels(material(options), mesh.dimension)),
        sweeper_(problem_, coloured_, *kernels_, options.regularisation, PNorm{1}, -1, team_) {}

  void reset() {
    problem_.positions = start_;
    sweeper_.rebuild();
    sweeper_.scan();
  }
  void sweep() { sweeper_.sweep(); }
  /// The work between two sweeps, which determines δ of the cells.
  void scan() { sweeper_.scan(); }

  const Problem& problem() const { return problem_; }
  double points() const { return points_visited(problem_); }

 private:
  Team team_{1};
  Problem problem_;
  std::vector<double> start_;
  ColouredNodes coloured_;
  std::unique_ptr<Kernels> kernels_;
  Sweeper sweeper_;
};

/// Products on one thread, summed over the cells of each node as conjugate gradients need them.
class ProductLoad {
 public:
  ProductLoad(const HighOrderMesh& mesh, const Options& options)
      : problem_(testing::make_problem(mesh)), hessian_(make_hessian_kernels(material(options), mesh.dimension)) {
    const std::unique_ptr<Kernels> kernels = make_kernels(material(options), mesh.dimension);
    hold_deformation(problem_, false);
    for (CellSet& block : problem_.sets)
      for (std::int32_t cell = 0; cell < block.count; ++cell) kernels->rebuild(block, cell, problem_.positions);
    batches_ = make_batches(problem_, *hessian_);
    for (BatchSet& block : batches_)
      for (std::int32_t b = 0; b < block.count; ++b)
        hessian_->linearise(block, b, block.cells->deformation_of(b * kBatch));
    const std::vector<double> random = testing::random_direction(problem_, 1);
    direction_.assign(random.begin(), random.end());
    direction_.resize(random.size() + padded(problem_.dimension));
    product_.resize(random.size());
  }

  void product() {
    for (BatchSet& block : batches_)
      for (std::int32_t b = 0; b < block.count; ++b) hessian_->apply(block, b, direction_);
    hessian_->add_up(problem_, batches_, direction_.data(), product_.data(), 0,
                     static_cast<std::int32_t>(problem_.free.size()));
  }

  std::int32_t cells() const { return problem_.cells; }
  double flops() const {
    double sum = 0;
    for (const BatchSet& block : batches_) sum += block.cells->count * product_flops(block);
    return sum;
  }

 private:
  Problem problem_;
  std::unique_ptr<HessianKernels> hessian_;
  std::vector<BatchSet> batches_;
  std::vector<float> direction_, product_;
};

}  // namespace varimesh::bench
