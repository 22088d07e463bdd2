// Problems made from meshes in tests, and plain whole-mesh sums to compare with.
#pragma once

#include <random>
#include <vector>

#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/kernels/node_star.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"

namespace varimesh::testing {

/// A mesh as the kernels see it, with straight-sided targets. The deformation gradients are not set.
inline Problem make_problem(const HighOrderMesh& mesh, int quadrature_degree = 0) {
  Problem problem = build_problem(mesh, fixed_nodes(mesh), quadrature_degree);
  problem.positions = solver_positions(mesh, frame_of(mesh));
  set_straight_sided_targets(problem);
  return problem;
}

/// Random numbers of up to 0.02, one for every component of every free node.
inline std::vector<double> random_direction(const Problem& problem, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-0.02, 0.02);
  std::vector<double> direction(problem.free.size() * problem.dimension);
  for (double& component : direction) component = uniform(random);
  return direction;
}

/// The energy of the whole mesh, its gradient and its Hessian's products as functions of the free nodes.
class WholeMesh {
 public:
  WholeMesh(Problem& problem, const Kernels& plain) : problem_(problem), plain_(plain), start_(problem.positions) {}

  /// The energy with the free nodes displaced by `amount` times `direction`.
  double energy(const std::vector<double>& direction, double amount) {
    place(direction, amount, plain_);
    double sum = 0;
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) sum += plain_.scan_kept(set, cell).energy;
    place(direction, 0, plain_);
    return sum;
  }

  std::vector<double> gradient(const Kernels& kernels) {
    std::vector<double> out;
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank) {
      const StarExpansion expansion = kernels.expand(NodeStar(problem_, rank).cells());
      out.insert(out.end(), expansion.gradient.begin(), expansion.gradient.begin() + problem_.dimension);
    }
    return out;
  }

  std::vector<double> gradient_at(const std::vector<double>& direction, double amount, const Kernels& kernels) {
    place(direction, amount, kernels);
    std::vector<double> out = gradient(kernels);
    place(direction, 0, kernels);
    return out;
  }

  std::vector<double> product(const HessianKernels& hessian, const std::vector<double>& direction) {
    const int d = problem_.dimension;
    std::vector<BatchSet> batches = make_batches(problem_, hessian);
    std::vector<float> input(direction.begin(), direction.end());
    input.resize(input.size() + padded(d));
    std::vector<double> out(direction.size());
    for (BatchSet& set : batches)
      for (std::int32_t b = 0; b < set.count; ++b) {
        hessian.linearise(set, b, set.cells->deformation_of(b * kBatch));
        hessian.apply(set, b, input);
      }
    for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
      for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
        const Incidence& at = problem_.incidences[i];
        const BatchSet& set = batches[at.set];
        for (int k = 0; k < d; ++k)
          out[rank * d + k] += set.contributions[set.contribution_index(at.cell, at.local, d) + k];
      }
    return out;
  }

 private:
  void place(const std::vector<double>& direction, double amount, const Kernels& kernels) {
    const int d = problem_.dimension;
    for (std::size_t rank = 0; rank < problem_.free.size(); ++rank)
      for (int k = 0; k < d; ++k) {
        const std::size_t at = std::size_t(problem_.free[rank]) * d + k;
        problem_.positions[at] = start_[at] + amount * direction[rank * d + k];
      }
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) kernels.rebuild(set, cell, problem_.positions);
  }

  Problem& problem_;
  const Kernels& plain_;
  std::vector<double> start_;
};

}  // namespace varimesh::testing
