#include "core/solvers/descent/loss_objective.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/base/io/large_arrays.h"

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 4096;
constexpr double kNoise = 1e-13;  // of the sum

}  // namespace

LossObjective::LossObjective(Problem& problem, CellEnergy& energy, ModalForm& form, OrderLevels& levels,
                             const Material& material, const Team& team, const ProblemPart* part)
    : problem_(problem),
      energy_(energy),
      form_(form),
      levels_(levels),
      material_(material),
      team_(team),
      part_(part),
      own_nodes_(part != nullptr ? at(part->share.own_nodes) : problem.free.size()),
      unknowns_(own_nodes_ * at(problem.dimension)),
      reduction_(whole_reduction(team, part)) {
  const std::size_t numbers = problem.free.size() * problem.dimension;
  for (auto* vector : {&gradient_, &start_, &step_, &residual_, &direction_, &product_}) resize_large(*vector, numbers);
  for (auto* vector : {&rough_direction_, &rough_product_})
    resize_large(*vector, numbers + static_cast<std::size_t>(padded(problem.dimension)));
  std::fill(rough_direction_.begin() + static_cast<std::ptrdiff_t>(gradient_.size()), rough_direction_.end(), 0.0F);
}

void LossObjective::hold_vertices(std::span<const double> hold, std::span<const double> places) {
  places_ = places;
  hold_.resize(own_nodes_);
  const std::int32_t all_cells = part_ != nullptr ? part_->whole->cells : problem_.cells;
  const auto hold_of = [&](const Incidence& in) {
    return part_ != nullptr ? hold[at(part_->whole->sets[at(in.set)].first + part_->cells[at(in.set)][at(in.cell)])]
                            : hold[at(problem_.sets[at(in.set)].first + in.cell)];
  };
  team_.for_ranges(hold_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      double sum = 0;
      for (std::int64_t i = problem_.offsets[f]; i < problem_.offsets[f + 1]; ++i) {
        const Incidence& incidence = problem_.incidences[i];
        const CellSet& set = problem_.sets[incidence.set];
        const int vertices = reference::info(set.shape).vertices;
        if (incidence.local < vertices) sum += hold_of(incidence) / vertices / all_cells;
      }
      hold_[f] = sum;
    }
  });
}

double LossObjective::held() const {
  const std::size_t d = problem_.dimension;
  return reduction_.sum(hold_.size(), kNumbersPerTask, [&](std::size_t f) {
    double square = 0;
    for (std::size_t k = 0; k < d && hold_[f] > 0; ++k) {
      const double moved = problem_.positions[problem_.free[f] * d + k] - places_[f * d + k];
      square += moved * moved;
    }
    return hold_[f] * square;
  });
}

double LossObjective::form() {
  if (!has_form_) form_value_ = form_.gradient(product_);
  has_form_ = true;
  return form_value_;
}

double LossObjective::linearise(bool /*renews*/) {
  energy_.fit_scale();
  energy_.linearise(gradient_);
  is_convex_ = false;
  const double value = energy_.value() + form() + held();
  noise_ = kNoise * value;
  add_form();
  clear_step();
  return value;
}

void LossObjective::add_form() {
  const std::size_t d = problem_.dimension;
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double moved = problem_.positions[problem_.free[i / d] * d + i % d] - places_[i];
      gradient_[i] += product_[i] + 2 * hold_[i / d] * moved;
      residual_[i] = -gradient_[i];
    }
  });
}

void LossObjective::clear_step() {
  team_.for_ranges(unknowns_, kNumbersPerTask,
                   [&](std::size_t begin, std::size_t end) { std::fill_n(step_.data() + begin, end - begin, 0.0); });
}

bool LossObjective::make_convex() {
  if (is_convex_ || material_.energy != Energy::Hyperelastic) return false;
  is_convex_ = true;
  energy_.keep_convex_part(material_);
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) residual_[i] = -gradient_[i];
  });
  clear_step();
  return true;
}

// ===== Conjugate gradients =====

double LossObjective::precondition() {
  has_form_ = false;
  return levels_.apply(residual_, product_);
}

double LossObjective::multiply() {
  has_form_ = false;
  if (part_ != nullptr) part_->share.directions.exchange(direction_.data(), at(problem_.dimension), reduction_.ranks());
  team_.for_ranges(direction_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) rough_direction_[i] = static_cast<float>(direction_[i]);
  });
  energy_.multiply(rough_direction_, rough_product_);
  form_.multiply(direction_, product_);
  const double scale = energy_.scale();
  const std::size_t d = problem_.dimension;
  return reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) {
    product_[i] += scale * static_cast<double>(rough_product_[i]) + 2 * hold_[i / d] * direction_[i];
    return direction_[i] * product_[i];
  });
}

void LossObjective::advance(double alpha) {
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      step_[i] += alpha * direction_[i];
      residual_[i] -= alpha * product_[i];
    }
  });
}

void LossObjective::turn(double beta) {
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) direction_[i] = product_[i] + (beta == 0 ? 0 : beta * direction_[i]);
  });
}

// ===== Sizes =====

double LossObjective::gradient_norm() {
  return std::sqrt(
      reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) { return gradient_[i] * gradient_[i]; }));
}

double LossObjective::preconditioned_norm(double rq) const { return std::sqrt(std::max(0.0, rq)); }

template <class Displacement>
double LossObjective::largest_of(const Displacement& displacement) const {
  const std::size_t d = problem_.dimension;
  return std::sqrt(reduction_.largest(own_nodes_, kNumbersPerTask, [&](std::size_t f) {
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) square += displacement(f, k) * displacement(f, k);
    return square * problem_.inverse_size[f] * problem_.inverse_size[f];
  }));
}

double LossObjective::largest(std::span<const double> displacements) const {
  const std::size_t d = problem_.dimension;
  return largest_of([&](std::size_t f, std::size_t k) { return displacements[f * d + k]; });
}

double LossObjective::largest_from(std::span<const double> positions) const {
  const std::size_t d = problem_.dimension;
  return largest_of([&](std::size_t f, std::size_t k) {
    const std::int32_t node = problem_.free[f], whole = part_ != nullptr ? part_->nodes[at(node)] : node;
    return problem_.positions[at(node) * d + k] - positions[at(whole) * d + k];
  });
}

double LossObjective::largest_defect() {
  shared_copy<double>(residual_, direction_, team_);
  energy_.gradient(gradient_);
  form();
  add_form();
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) residual_[i] -= direction_[i];
  });
  precondition();
  return largest(product_);
}

// ===== The step =====

double LossObjective::finish_step() {
  const std::size_t d = problem_.dimension;
  team_.for_ranges(own_nodes_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) std::copy_n(&problem_.positions[problem_.free[f] * d], d, &start_[f * d]);
  });
  return reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) { return gradient_[i] * step_[i]; });
}

template <class PositionOf>
void LossObjective::place(const PositionOf& position_of, const Team& team) {
  const std::size_t d = at(problem_.dimension);
  team.for_ranges(own_nodes_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t k = 0; k < d; ++k) problem_.positions[at(problem_.free[f]) * d + k] = position_of(f * d + k);
  });
  if (part_ != nullptr) part_->share.positions.exchange(problem_.positions.data(), d, reduction_.ranks());
  has_form_ = false;
}

double LossObjective::move(double alpha) {
  place([&](std::size_t number) { return start_[number] + alpha * step_[number]; }, team_);
  energy_.scan();
  const double energy = energy_.value();
  return std::isfinite(energy) ? energy + form() + held() : energy;
}

void LossObjective::go_back() {
  place([&](std::size_t number) { return start_[number]; }, team_.without_stop());
}

}  // namespace varimesh
