#include "core/solvers/newton/newton.h"

#include <utility>
#include <vector>

#include "core/base/index.h"

namespace varimesh {

Newton::Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
               double tolerance, const Team& team)
    : problem_(problem), kernels_(kernels), hessian_(hessian), norm_(norm), tolerance_(tolerance), team_(team) {
  use_processor();
  method_.emplace(*on_processor_, rules(tolerance));
}

Newton::Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
               double tolerance, const Team& team, device::RunDevice& device, const Material& material)
    : problem_(problem),
      kernels_(kernels),
      hessian_(hessian),
      norm_(norm),
      tolerance_(tolerance),
      team_(team),
      device_(&device) {
  if (device::Device* const there = device.get(); there != nullptr) {
    try {
      on_device_ = std::make_unique<DeviceObjective>(*there, problem, kernels, hessian, material, norm, team);
      method_.emplace(*on_device_, rules(tolerance));
      return;
    } catch (const DeviceFailed& failed) {
      device.give_up(failed.fault);
    }
  }
  use_processor();
  method_.emplace(*on_processor_, rules(tolerance));
}

Newton::Newton(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
               double tolerance, const Team& team, const Ranks& ranks)
    : problem_(problem), kernels_(kernels), hessian_(hessian), norm_(norm), tolerance_(tolerance), team_(team) {
  part_.emplace(part_of(problem, ranks));
  scans_.resize(at(problem.cells));
  use_processor();
  method_.emplace(*on_processor_, rules(tolerance));
}

NewtonRules Newton::rules(double tolerance) {
  NewtonRules rules;
  rules.most_products = kMostProducts;
  rules.tolerance = tolerance;
  return rules;
}

void Newton::use_processor() {
  on_processor_ = part_ ? std::make_unique<MeshObjective>(*part_, kernels_, hessian_, norm_, team_)
                        : std::make_unique<MeshObjective>(problem_, kernels_, hessian_, norm_, team_);
}

void Newton::solve_roughly(int most_products) { method_->solve_roughly(most_products); }

void Newton::count_with(WorkMeter* meter, const PointOperations& point) {
  meter_ = meter;
  point_ = point;
  if (on_device_)
    on_device_->count_with(meter);
  else
    on_processor_->count_with(meter, point);
}

NewtonOutcome Newton::step_of_part() {
  part_->follow();
  const NewtonOutcome outcome = method_->step();
  gather_positions(*part_, problem_.positions);
  gather_cells<CellScan>(*part_, on_processor_->scans(), scans_);
  return outcome;
}

NewtonOutcome Newton::step() {
  if (part_) return step_of_part();
  if (!on_device_) return method_->step();
  const NewtonMethod before = *method_;
  std::vector<double> positions = problem_.positions;
  try {
    const NewtonOutcome outcome = method_->step();
    device_->begin();
    return outcome;
  } catch (const DeviceFailed& failed) {
    problem_.positions = std::move(positions);
    leave_device(failed.fault, before);
  }
  return method_->step();
}

void Newton::leave_device(const device::Fault& fault, const NewtonMethod& before) {
  device_->give_up(fault);
  // Both objectives keep the slopes of the cells in the problem, so the first one ends before the second begins.
  method_.reset();
  on_device_.reset();
  use_processor();
  on_processor_->count_with(meter_, point_);
  method_.emplace(*on_processor_, before);
}

}  // namespace varimesh
