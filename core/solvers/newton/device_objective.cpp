#include "core/solvers/newton/device_objective.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/device_kernels/cell_modules.h"
#include "core/terms/power_of_two.h"

namespace varimesh {
DeviceObjective::DeviceObjective(device::Device& device, Problem& problem, const Kernels& kernels,
                                 const HessianKernels& hessian, const Material& material, const PNorm& norm,
                                 const Team& team)
    : MinimisedOnDevice(device, problem, device::solver_kernels(problem.dimension), material, team),
      energy_(problem, kernels, hessian, norm, team) {
  preconditioner_.emplace(queue_, module_.get(), *cells_, problem, energy_.batches(), *joiner_, team);
  residual_ = queue_.room(at(unknowns_) * sizeof(float));
  find({{"clear_step", &clear_step_},
        {"scale_residual", &scale_residual_},
        {"add_residual", &add_residual_},
        {"size_of_gradient", &size_of_gradient_}});
  check();
}

device::VectorArguments DeviceObjective::arguments(std::int64_t count) const {
  device::VectorArguments a = common(count);
  a.residual = residual_.as<float>();
  a.direction = cells_->direction_there().as<float>();
  a.product = cells_->product_there().as<float>();
  a.start = a.gradient;  // a step that can be taken needs the gradient no more
  return a;
}

double DeviceObjective::linearise(bool renews) {
  if (meter_ != nullptr) meter_->begin(Activity::Assembly, 3);
  const auto next_part = [&] {
    check();
    team_.look();
    if (meter_ != nullptr) meter_->add(1);
  };
  queue_.note(cells_->place());
  queue_.note(cells_->weigh());
  check();
  scan(energy_);
  energy_.fit_scale_to_scans();
  energy_.set_slopes();
  queue_.note(cells_->weigh(energy_.curvatures()));
  next_part();
  queue_.note(cells_->run_gradient(true, energy_.scale()));
  preconditioner_->make_blocks();
  next_part();
  if (renews) preconditioner_->assemble();
  run(clear_step_);
  scale_residual();
  next_part();
  step_scale_ = correction_scale_ = gradient_scale_ / energy_.scale();
  if (meter_ != nullptr) meter_->begin(Activity::Products);
  return energy_.value();
}

void DeviceObjective::scale_residual() {
  gradient_scale_ = power_of_two(largest(size_of_gradient_, unknowns_));
  run(scale_residual_, gradient_scale_);
}

// ===== Conjugate gradients =====

double DeviceObjective::precondition() {
  const double along = preconditioner_->apply(residual_.as<const float>(), cells_->product_there().as<float>());
  check();
  return along;
}

double DeviceObjective::multiply() {
  team_.look();
  cells_->leave_parts_in(joiner_->parts(nodes_));
  queue_.note(cells_->run_product());
  const double curvature = joiner_->sum(nodes_);
  check();
  if (meter_ != nullptr) meter_->add(1);
  return curvature;
}

// ===== Sizes =====

double DeviceObjective::preconditioned_norm(double rq) const {
  return std::sqrt(std::max(0.0, rq)) * gradient_scale_ / std::sqrt(energy_.scale());
}

double DeviceObjective::largest_defect() {
  run(vectors_.keep_residual);
  // The slopes of the p-norm are others where the nodes are now.
  energy_.set_slopes();
  queue_.note(cells_->weigh());
  queue_.note(cells_->run_gradient(false, energy_.scale()));
  run(add_residual_, gradient_scale_);
  scale_residual();
  precondition();
  return largest_of_nodes(vectors_.size_of_product) * (gradient_scale_ / energy_.scale());
}

// ===== The step =====

double DeviceObjective::finish_step() {
  const double slope = sum(vectors_.along_step, unknowns_, step_scale_);
  step_scale_ = 1;
  run_on_nodes(vectors_.keep_start);
  check();
  return slope;
}

double DeviceObjective::move(double alpha) {
  team_.look();
  run_on_nodes(vectors_.place, alpha);
  check();
  scan(energy_);
  return energy_.value();
}

std::size_t DeviceObjective::memory() const {
  return memory_in_common() + preconditioner_->memory() + residual_.bytes();
}

}  // namespace varimesh
