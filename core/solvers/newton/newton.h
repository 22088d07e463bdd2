// Newton's method on the energy of a whole mesh: all free nodes move at once.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/device/run_device.h"
#include "core/energy/material.h"
#include "core/solvers/newton/device_objective.h"
#include "core/solvers/newton/mesh_objective.h"
#include "core/solvers/newton_method.h"

namespace varimesh {

/// Newton steps on a problem (newton_method.h). The vectors are on the processor (mesh_objective.h) or on a device
/// (device_objective.h). Several ranks may share them: each rank works on its part of the problem (problem_part.h). The
/// line search never makes a valid cell invalid.
class Newton {
 public:
  /// The most products of the Hessian and a direction in a step. Usual steps need 5 to 60 products, and 400 at λ = 640.
  /// If a step needs more than this, the preconditioner does not fit the energy.
  static constexpr int kMostProducts = 1000;

  /// `tolerance`: the residual at which the run will end. Steps are solved as tightly as is useful to get there.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team);
  /// The same on the run's device, as long as it has one. After a fault, this step and all further steps are made on
  /// the processor.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team, device::RunDevice& device, const Material& material);
  /// The same, shared by these ranks. Each rank has the whole problem and works on a part of it. All ranks call step()
  /// together, and afterwards all have the positions of all nodes and the scans of all cells, with the bits of a Newton
  /// without ranks. The team's token is one of all ranks (core/ranks/stop_together.h), or there is none.
  Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm, double tolerance,
         const Team& team, const Ranks& ranks);
  Newton(const Newton&) = delete;
  Newton& operator=(const Newton&) = delete;

  void solve_roughly(int most_products);
  void count_with(WorkMeter* meter, const PointOperations& point);

  /// If the team's token interrupts it, the nodes are where they were before, or where the step has put them.
  NewtonOutcome step();

  /// Whether the last step was made on a device.
  bool is_on_device() const { return on_device_ != nullptr; }

  /// By cell: the scans after the step, with the δ from before it.
  std::span<const CellScan> scans() const {
    if (part_) return scans_;
    return on_device_ ? on_device_->scans() : on_processor_->scans();
  }

  /// Reads or writes what a step leaves for the next. It does not depend on where the vectors are, nor on the number of
  /// ranks, which all call it together.
  template <class Archive>
  void state(Archive& archive) {
    method_->state(archive);
    if (on_device_)
      on_device_->state(archive, !method_->renews());
    else
      on_processor_->preconditioner().state(archive, !method_->renews());
  }

 private:
  static NewtonRules rules(double tolerance);
  void use_processor();
  NewtonOutcome step_of_part();
  /// Gives the device up, and puts the method where it was before the step that failed. The nodes are there already.
  void leave_device(const device::Fault& fault, const NewtonMethod& before);

  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels& hessian_;
  const PNorm norm_;
  const double tolerance_;
  const Team& team_;
  device::RunDevice* device_ = nullptr;
  WorkMeter* meter_ = nullptr;
  PointOperations point_;
  std::optional<ProblemPart> part_;             ///< With ranks: what this one works on,
  std::vector<CellScan> scans_;                 ///< and the scans of all cells.
  std::unique_ptr<DeviceObjective> on_device_;  ///< One of these two is there.
  std::unique_ptr<MeshObjective> on_processor_;
  std::optional<NewtonMethod> method_;
};

}  // namespace varimesh
