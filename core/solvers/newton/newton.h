// Newton's method on the energy of a whole mesh: all free nodes move at once.
#pragma once

#include <span>

#include "core/solvers/newton/mesh_objective.h"
#include "core/solvers/newton_method.h"

namespace varimesh {

/// Newton steps on a problem (newton_method.h, mesh_objective.h). The line search never makes a valid cell invalid.
class Newton {
 public:
  /// Of the Hessian and a direction, per step. Usual steps need 5 to 60, and 400 at λ = 640. If a step needs more than
  /// this, the preconditioner does not fit the energy.
  static constexpr int kMostProducts = 1000;

  /// `tolerance`: the residual at which the run will end. Steps are solved as tightly as is useful to get there.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team)
      : objective_(problem, kernels, hessian, norm, team), method_(objective_, rules(tolerance)) {}
  Newton(const Newton&) = delete;
  Newton& operator=(const Newton&) = delete;

  void solve_roughly(int most_products) { method_.solve_roughly(most_products); }
  void count_with(WorkMeter* meter, const PointOperations& point) { objective_.count_with(meter, point); }

  /// If the team's token interrupts it, the nodes are where they were before, or where the step has put them.
  NewtonOutcome step() { return method_.step(); }

  /// By cell: the scans after the step, with the δ from before it.
  std::span<const CellScan> scans() const { return objective_.scans(); }

  /// Reads or writes what a step leaves for the next.
  template <class Archive>
  void state(Archive& archive) {
    method_.state(archive);
    objective_.preconditioner().state(archive, !method_.renews());
  }

 private:
  static NewtonRules rules(double tolerance) {
    NewtonRules rules;
    rules.most_products = kMostProducts;
    rules.tolerance = tolerance;
    return rules;
  }

  MeshObjective objective_;
  NewtonMethod method_;
};

}  // namespace varimesh
