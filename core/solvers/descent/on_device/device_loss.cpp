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
    : MinimisedOnDevice(device, problem, device::descent_kernels(problem.dimension), material, team),
      energy_(energy),
      has_convex_part_(material.energy == Energy::Hyperelastic) {
  std::size_t numbers = 0;
  for (const auto& set : cells_->sets()) numbers = std::max(numbers, set->contributions() * at(problem.dimension));
  values_.emplace(queue_, module_.get(), numbers);
  // Contributions have two floats for each double.
  levels_.emplace(queue_, module_.get(), problem, levels, *values_, cells_->contributions().as<double>(), *joiner_,
                  team);
  form_.emplace(queue_, module_.get(), *cells_, problem, form, levels_->own(), *values_, *joiner_);
  for (device::Buffer* vector : {&start_, &residual_, &direction_, &product_})
    *vector = queue_.room(at(unknowns_) * sizeof(double));
  find({{"add_up_form", &add_up_form_},
        {"add_form", &add_form_},
        {"held", &held_},
        {"begin_system", &begin_system_},
        {"round_direction", &round_direction_},
        {"add_up_product", &add_up_product_},
        {"subtract_kept", &subtract_kept_}});
  check();
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
  device::LossArguments a = common(count);
  a.start = start_.as<double>();
  a.residual = residual_.as<double>();
  a.direction = direction_.as<double>();
  a.product = product_.as<double>();
  a.hold = hold_.as<const double>();
  a.held_at = held_at_.as<const double>();
  a.rough_direction = cells_->direction_there().as<float>();
  a.rough_product = cells_->product_there().as<const float>();
  a.own = levels_->own().arguments(cells_->contributions().as<const double>());
  return a;
}

// ===== The objective and its derivatives =====

double DeviceLoss::form() {
  if (!has_form_) {
    form_value_ = form_->gradient();
    run_on_nodes(add_up_form_);
    check();
  }
  has_form_ = true;
  return form_value_;
}

double DeviceLoss::linearise(bool /*renews*/) {
  team_.look();
  queue_.note(cells_->place());
  check();
  scan(energy_);
  energy_.fit_scale();
  energy_.set_slopes();
  queue_.note(cells_->weigh());
  queue_.note(cells_->run_gradient(true, energy_.scale()));
  is_convex_ = false;
  const double value = energy_.value() + form() + sum(held_, nodes_);
  noise_ = kNoise * value;
  run_on_nodes(add_form_);
  run(begin_system_);
  check();
  return value;
}

bool DeviceLoss::make_convex() {
  if (is_convex_ || !has_convex_part_) return false;
  is_convex_ = true;
  queue_.note(cells_->run_convex_part());
  run(begin_system_);
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
  run(round_direction_);
  queue_.note(cells_->run_product());
  form_->multiply(direction_.as<const double>());
  return sum(add_up_product_, nodes_, energy_.scale());
}

// ===== Sizes =====

double DeviceLoss::preconditioned_norm(double rq) const { return std::sqrt(std::max(0.0, rq)); }

double DeviceLoss::largest_defect() {
  run(vectors_.keep_residual);
  queue_.note(cells_->run_gradient(false, energy_.scale()));
  form();
  run_on_nodes(add_form_);
  run(subtract_kept_);
  precondition();
  return largest_of_nodes(vectors_.size_of_product);
}

// ===== The step =====

double DeviceLoss::finish_step() {
  run_on_nodes(vectors_.keep_start);
  return sum(vectors_.along_step, unknowns_, 1);
}

double DeviceLoss::move(double alpha) {
  team_.look();
  run_on_nodes(vectors_.place, alpha);
  has_form_ = false;
  check();
  scan(energy_);
  const double energy = energy_.value();
  return std::isfinite(energy) ? energy + form() + sum(held_, nodes_) : energy;
}

std::size_t DeviceLoss::memory() const {
  std::size_t bytes = memory_in_common() + values_->memory() + levels_->memory() + form_->memory();
  for (const device::Buffer* buffer : {&start_, &residual_, &direction_, &product_, &hold_, &held_at_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh
