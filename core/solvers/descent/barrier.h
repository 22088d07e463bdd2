// The energy as a barrier: its sum over the cells, each with a weight of its own.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/operations.h"
#include "core/kernels/kernels.h"
#include "core/preconditioner/reduction.h"
#include "core/problem/problem.h"
#include "core/progress/work_meter.h"

namespace varimesh {

/// B = 1/V Σ_e ε_e ∫ W(F) |det A| dξ, V being a constant.
class Barrier {
 public:
  /// Call it inside team.run(). All references must outlive the barrier.
  Barrier(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, double volume, const Team& team);
  ~Barrier();
  Barrier(const Barrier&) = delete;
  Barrier& operator=(const Barrier&) = delete;

  /// B at problem.positions. `weights`: ε_e by CellSet::first + cell. `gradient`: ∂B/∂x of the free nodes, d numbers
  /// each, in 48 bits per cell. +∞ if a cell without δ has J ≤ 0 at a quadrature point or a number is not finite; then
  /// the gradient has no meaning.
  double gradient(std::span<const double> weights, std::span<double> gradient);

  /// From now on counts what the kernels do with this meter, which must outlive the object; null: with none. `point`:
  /// the operations of the kernels' energy.
  void count_with(WorkMeter* meter, const PointOperations& point) {
    meter_ = meter;
    operations_ = mesh_operations(batches_, point);
  }

  /// Of the last gradient(), by CellSet::first + cell.
  std::span<const CellScan> scans() const { return scans_; }

 private:
  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels& hessian_;
  double volume_;
  const Team& team_;
  Reduction reduction_;
  std::vector<BatchSet> batches_;
  WorkMeter* meter_ = nullptr;
  MeshOperations operations_;
  std::vector<CellScan> scans_;
};

}  // namespace varimesh
