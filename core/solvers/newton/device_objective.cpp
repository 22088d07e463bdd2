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
    : queue_(device),
      problem_(problem),
      team_(team),
      energy_(problem, kernels, hessian, norm, team),
      solver_(queue_.load(device::solver_kernels(problem.dimension))),
      unknowns_(static_cast<std::int64_t>(problem.free.size()) * problem.dimension) {
  check();
  auto cells = device::CellsOnDevice::make(device, problem, material);
  if (!cells) throw DeviceFailed{cells.error()};
  cells_ = std::move(*cells);
  joiner_.emplace(queue_, solver_.get());
  preconditioner_.emplace(queue_, solver_.get(), *cells_, problem, energy_.batches(), *joiner_, team);
  copy();
  find_kernels();
  check();
}

void DeviceObjective::copy() {
  const std::size_t count = static_cast<std::size_t>(unknowns_);
  step_ = queue_.room(count * sizeof(double));
  residual_ = queue_.room(count * sizeof(float));
  queue_.fill(free_, problem_.free);
  queue_.fill(inverse_size_, problem_.inverse_size);
}

void DeviceObjective::find_kernels() {
  for (const auto& [name, kernel] : {std::pair<const char*, device::Kernel*>{"advance", &kernels_.advance},
                                     {"turn", &kernels_.turn},
                                     {"take_direction", &kernels_.take_direction},
                                     {"clear_step", &kernels_.clear_step},
                                     {"scale_residual", &kernels_.scale_residual},
                                     {"keep_residual", &kernels_.keep_residual},
                                     {"add_residual", &kernels_.add_residual},
                                     {"keep_start", &kernels_.keep_start},
                                     {"place", &kernels_.place},
                                     {"along_step", &kernels_.along_step},
                                     {"square_of_gradient", &kernels_.square_of_gradient},
                                     {"size_of_gradient", &kernels_.size_of_gradient},
                                     {"size_of_step", &kernels_.size_of_step},
                                     {"size_of_product", &kernels_.size_of_product}})
    *kernel = queue_.kernel(solver_.get(), name);
}

void DeviceObjective::check() const {
  if (queue_.fault()) throw DeviceFailed{*queue_.fault()};
}

device::VectorArguments DeviceObjective::arguments(std::int64_t count) const {
  device::VectorArguments a;
  a.count = count;
  a.step = step_.as<double>();
  a.residual = residual_.as<float>();
  a.direction = cells_->direction_there().as<float>();
  a.product = cells_->product_there().as<float>();
  a.gradient = cells_->gradient_there().as<double>();
  a.positions = cells_->positions_there().as<double>();
  a.free = free_.as<const std::int32_t>();
  a.inverse_size = inverse_size_.as<const float>();
  return a;
}

void DeviceObjective::run(const device::Kernel& kernel, double factor) {
  device::VectorArguments a = arguments(unknowns_);
  a.factor = factor;
  queue_.launch(kernel, a.count, a);
}

double DeviceObjective::sum(const device::Kernel& kernel, double factor) {
  device::VectorArguments a = arguments(unknowns_);
  a.factor = factor;
  a.parts = joiner_->parts(a.count);
  queue_.launch(kernel, a.count, a, device::kJoinBytes);
  const double sum = joiner_->sum(a.count);
  check();
  return sum;
}

double DeviceObjective::largest_of_nodes(const device::Kernel& kernel) {
  device::VectorArguments a = arguments(static_cast<std::int64_t>(problem_.free.size()));
  a.parts = joiner_->parts(a.count);
  queue_.launch(kernel, a.count, a, device::kJoinBytes);
  const double largest = joiner_->largest(a.count);
  check();
  return std::sqrt(largest);
}

void DeviceObjective::scan() {
  const auto scans = cells_->scan();
  if (!scans) throw DeviceFailed{scans.error()};
  std::ranges::copy(*scans, energy_.scans_to_fill().begin());
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
  scan();
  energy_.fit_scale_to_scans();
  energy_.set_slopes();
  queue_.note(cells_->weigh(energy_.curvatures()));
  next_part();
  queue_.note(cells_->run_gradient(true, energy_.scale()));
  preconditioner_->make_blocks();
  next_part();
  if (renews) preconditioner_->assemble();
  run(kernels_.clear_step);
  scale_residual();
  next_part();
  step_scale_ = correction_scale_ = gradient_scale_ / energy_.scale();
  if (meter_ != nullptr) meter_->begin(Activity::Products);
  return energy_.value();
}

void DeviceObjective::scale_residual() {
  device::VectorArguments a = arguments(unknowns_);
  a.parts = joiner_->parts(a.count);
  queue_.launch(kernels_.size_of_gradient, a.count, a, device::kJoinBytes);
  gradient_scale_ = power_of_two(joiner_->largest(a.count));
  run(kernels_.scale_residual, gradient_scale_);
}

// ===== Conjugate gradients =====

double DeviceObjective::precondition() {
  const double along = preconditioner_->apply(residual_.as<const float>(), cells_->product_there().as<float>());
  check();
  return along;
}

double DeviceObjective::multiply() {
  team_.look();
  const auto nodes = static_cast<std::int64_t>(problem_.free.size());
  cells_->leave_parts_in(joiner_->parts(nodes));
  queue_.note(cells_->run_product());
  const double curvature = joiner_->sum(nodes);
  check();
  if (meter_ != nullptr) meter_->add(1);
  return curvature;
}

void DeviceObjective::advance(double alpha) { run(kernels_.advance, alpha); }
void DeviceObjective::turn(double beta) { run(kernels_.turn, beta); }
void DeviceObjective::take_direction() { run(kernels_.take_direction); }

// ===== Sizes =====

double DeviceObjective::gradient_norm() { return std::sqrt(sum(kernels_.square_of_gradient)); }

double DeviceObjective::preconditioned_norm(double rq) const {
  return std::sqrt(std::max(0.0, rq)) * gradient_scale_ / std::sqrt(energy_.scale());
}

double DeviceObjective::largest_step() { return largest_of_nodes(kernels_.size_of_step) * step_scale_; }

double DeviceObjective::largest_correction() { return largest_of_nodes(kernels_.size_of_product) * correction_scale_; }

double DeviceObjective::largest_defect() {
  run(kernels_.keep_residual);
  // The slopes of the p-norm are others where the nodes are now.
  energy_.set_slopes();
  queue_.note(cells_->weigh());
  queue_.note(cells_->run_gradient(false, energy_.scale()));
  run(kernels_.add_residual, gradient_scale_);
  scale_residual();
  precondition();
  return largest_of_nodes(kernels_.size_of_product) * (gradient_scale_ / energy_.scale());
}

// ===== The step =====

double DeviceObjective::finish_step() {
  const double slope = sum(kernels_.along_step, step_scale_);
  step_scale_ = 1;
  const device::VectorArguments a = arguments(static_cast<std::int64_t>(problem_.free.size()));
  queue_.launch(kernels_.keep_start, a.count, a);
  check();
  return slope;
}

double DeviceObjective::noise() { return energy_.noise(); }

double DeviceObjective::move(double alpha) {
  team_.look();
  device::VectorArguments a = arguments(static_cast<std::int64_t>(problem_.free.size()));
  a.factor = alpha;
  queue_.launch(kernels_.place, a.count, a);
  check();
  scan();
  return energy_.value();
}

void DeviceObjective::settle() {
  std::vector<double> positions(problem_.positions.size());
  queue_.download(cells_->positions_there(), std::span<double>(positions));
  check();
  problem_.positions = std::move(positions);
}

std::size_t DeviceObjective::memory() const {
  return cells_->memory() + preconditioner_->memory() + joiner_->memory() + step_.bytes() + residual_.bytes() +
         free_.bytes() + inverse_size_.bytes();
}

}  // namespace varimesh
