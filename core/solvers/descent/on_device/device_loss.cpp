#include "core/solvers/descent/on_device/device_loss.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/device_kernels/cell_modules.h"

namespace varimesh {
namespace {

constexpr double kNoise = 1e-13;  // of the sum, as LossObjective

}  // namespace

DeviceLoss::DeviceLoss(device::Device& device, Problem& problem, CellEnergy& energy, const ModalForm& form,
                       const OrderLevels& levels, const Material& material, const Team& team)
    : queue_(device),
      problem_(problem),
      energy_(energy),
      team_(team),
      has_convex_part_(material.energy == Energy::Hyperelastic),
      nodes_(static_cast<std::int64_t>(problem.free.size())),
      unknowns_(nodes_ * problem.dimension),
      descent_(queue_.load(device::descent_kernels(problem.dimension))) {
  check();
  auto cells = device::CellsOnDevice::make(device, problem, material);
  if (!cells) throw DeviceFailed{cells.error()};
  cells_ = std::move(*cells);
  joiner_.emplace(queue_, descent_.get());
  std::size_t numbers = 0;
  for (const auto& set : cells_->sets()) numbers = std::max(numbers, set->contributions() * at(problem.dimension));
  values_.emplace(queue_, descent_.get(), numbers);
  // Contributions have two floats for each double.
  levels_.emplace(queue_, descent_.get(), problem, levels, *values_, cells_->contributions().as<double>(), *joiner_);
  form_.emplace(queue_, descent_.get(), *cells_, problem, form, levels_->own(), *values_, *joiner_);
  for (device::Buffer* vector : {&start_, &step_, &residual_, &direction_, &product_})
    *vector = queue_.room(at(unknowns_) * sizeof(double));
  queue_.fill(free_, problem.free);
  queue_.fill(inverse_size_, problem.inverse_size);
  find_kernels();
  check();
}

void DeviceLoss::find_kernels() {
  for (const auto& [name, kernel] : {std::pair<const char*, device::Kernel*>{"add_up_form", &kernels_.add_up_form},
                                     {"add_form", &kernels_.add_form},
                                     {"held", &kernels_.held},
                                     {"begin_system", &kernels_.begin_system},
                                     {"round_direction", &kernels_.round_direction},
                                     {"add_up_product", &kernels_.add_up_product},
                                     {"advance", &kernels_.advance},
                                     {"turn", &kernels_.turn},
                                     {"take_direction", &kernels_.take_direction},
                                     {"keep_residual", &kernels_.keep_residual},
                                     {"subtract_kept", &kernels_.subtract_kept},
                                     {"square_of_gradient", &kernels_.square_of_gradient},
                                     {"along_step", &kernels_.along_step},
                                     {"size_of_step", &kernels_.size_of_step},
                                     {"size_of_product", &kernels_.size_of_product},
                                     {"keep_start", &kernels_.keep_start},
                                     {"place", &kernels_.place}})
    *kernel = queue_.kernel(descent_.get(), name);
}

void DeviceLoss::check() const {
  if (queue_.fault()) throw DeviceFailed{*queue_.fault()};
}

void DeviceLoss::begin_round(std::span<const double> hold, std::span<const double> places) {
  form_->take_frames();
  levels_->take_diagonals();
  queue_.fill(hold_, hold);
  queue_.fill(held_at_, places);
  has_form_ = false;
  check();
}

device::LossArguments DeviceLoss::arguments(std::int64_t count) const {
  device::LossArguments a;
  a.count = count;
  a.gradient = cells_->gradient_there().as<double>();
  a.start = start_.as<double>();
  a.step = step_.as<double>();
  a.residual = residual_.as<double>();
  a.direction = direction_.as<double>();
  a.product = product_.as<double>();
  a.positions = cells_->positions_there().as<double>();
  a.free = free_.as<const std::int32_t>();
  a.inverse_size = inverse_size_.as<const float>();
  a.hold = hold_.as<const double>();
  a.held_at = held_at_.as<const double>();
  a.rough_direction = cells_->direction_there().as<float>();
  a.rough_product = cells_->product_there().as<const float>();
  a.own = levels_->own().arguments(cells_->contributions().as<const double>());
  return a;
}

void DeviceLoss::run(const device::Kernel& kernel, double factor) {
  device::LossArguments a = arguments(unknowns_);
  a.factor = factor;
  queue_.launch(kernel, a.count, a);
}

void DeviceLoss::run_on_nodes(const device::Kernel& kernel, double factor) {
  device::LossArguments a = arguments(nodes_);
  a.factor = factor;
  queue_.launch(kernel, a.count, a);
}

double DeviceLoss::sum(const device::Kernel& kernel, std::int64_t count, double factor) {
  device::LossArguments a = arguments(count);
  a.factor = factor;
  a.parts = joiner_->parts(count);
  queue_.launch(kernel, count, a, device::kJoinBytes);
  const double sum = joiner_->sum(count);
  check();
  return sum;
}

double DeviceLoss::largest(const device::Kernel& kernel) {
  device::LossArguments a = arguments(nodes_);
  a.parts = joiner_->parts(nodes_);
  queue_.launch(kernel, nodes_, a, device::kJoinBytes);
  const double largest = joiner_->largest(nodes_);
  check();
  return std::sqrt(largest);
}

// ===== The objective and its derivatives =====

void DeviceLoss::scan() {
  const auto scans = cells_->scan();
  if (!scans) throw DeviceFailed{scans.error()};
  std::ranges::copy(*scans, energy_.scans_to_fill().begin());
}

double DeviceLoss::form() {
  if (!has_form_) {
    form_value_ = form_->gradient();
    run_on_nodes(kernels_.add_up_form);
    check();
  }
  has_form_ = true;
  return form_value_;
}

double DeviceLoss::linearise(bool /*renews*/) {
  team_.look();
  queue_.note(cells_->place());
  check();
  scan();
  energy_.fit_scale();
  energy_.set_slopes();
  queue_.note(cells_->weigh());
  queue_.note(cells_->run_gradient(true, energy_.scale()));
  is_convex_ = false;
  const double value = energy_.value() + form() + sum(kernels_.held, nodes_);
  noise_ = kNoise * value;
  run_on_nodes(kernels_.add_form);
  run(kernels_.begin_system);
  check();
  return value;
}

bool DeviceLoss::make_convex() {
  if (is_convex_ || !has_convex_part_) return false;
  is_convex_ = true;
  queue_.note(cells_->run_convex_part());
  run(kernels_.begin_system);
  check();
  return true;
}

// ===== Conjugate gradients =====

double DeviceLoss::precondition() {
  has_form_ = false;
  const double along = levels_->apply(residual_.as<double>(), product_.as<double>());
  check();
  return along;
}

double DeviceLoss::multiply() {
  team_.look();
  has_form_ = false;
  run(kernels_.round_direction);
  queue_.note(cells_->run_product());
  form_->multiply(direction_.as<const double>());
  return sum(kernels_.add_up_product, nodes_, energy_.scale());
}

// ===== Sizes =====

double DeviceLoss::gradient_norm() { return std::sqrt(sum(kernels_.square_of_gradient, unknowns_)); }

double DeviceLoss::preconditioned_norm(double rq) const { return std::sqrt(std::max(0.0, rq)); }

double DeviceLoss::largest_defect() {
  run(kernels_.keep_residual);
  queue_.note(cells_->run_gradient(false, energy_.scale()));
  form();
  run_on_nodes(kernels_.add_form);
  run(kernels_.subtract_kept);
  precondition();
  return largest(kernels_.size_of_product);
}

// ===== The step =====

double DeviceLoss::finish_step() {
  run_on_nodes(kernels_.keep_start);
  return sum(kernels_.along_step, unknowns_);
}

double DeviceLoss::move(double alpha) {
  team_.look();
  run_on_nodes(kernels_.place, alpha);
  has_form_ = false;
  check();
  scan();
  const double energy = energy_.value();
  return std::isfinite(energy) ? energy + form() + sum(kernels_.held, nodes_) : energy;
}

void DeviceLoss::settle() {
  std::vector<double> positions(problem_.positions.size());
  queue_.download(cells_->positions_there(), std::span<double>(positions));
  check();
  problem_.positions = std::move(positions);
}

std::size_t DeviceLoss::memory() const {
  std::size_t bytes = cells_->memory() + joiner_->memory() + values_->memory() + levels_->memory() + form_->memory();
  for (const device::Buffer* buffer :
       {&start_, &step_, &residual_, &direction_, &product_, &free_, &inverse_size_, &hold_, &held_at_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh
