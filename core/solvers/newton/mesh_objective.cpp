#include "core/solvers/newton/mesh_objective.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/terms/power_of_two.h"

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 16384;

}  // namespace

MeshObjective::MeshObjective(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
                             const Team& team, const ProblemPart* part)
    : problem_(problem),
      hessian_(hessian),
      team_(team),
      part_(part),
      own_nodes_(part != nullptr ? at(part->share.own_nodes) : problem.free.size()),
      reduction_(whole_reduction(team, part)),
      energy_(problem, kernels, hessian, norm, team, part != nullptr ? &part->share : nullptr),
      preconditioner_(problem, energy_.batches(), team, part),
      unknowns_(own_nodes_ * at(problem.dimension)),
      gradient_(unknowns_),
      step_(unknowns_),
      residual_(unknowns_),
      direction_(problem.free.size() * at(problem.dimension) + at(padded(problem.dimension))),
      product_(direction_.size()) {
  std::fill(product_.begin() + static_cast<std::ptrdiff_t>(unknowns_), product_.end(), 0.0F);
  std::fill(direction_.begin() + static_cast<std::ptrdiff_t>(unknowns_), direction_.end(), 0.0F);
}

double MeshObjective::linearise(bool renews) {
  begin_assembly(2 * energy_.gradient_work() + (renews ? preconditioner_.assembly_work() : 0));
  energy_.fit_scale();
  energy_.linearise(gradient_);
  energy_.for_blocks(
      [&](std::int32_t rank, const std::array<double, 6>& block) { preconditioner_.set_block(rank, block); });
  if (renews) preconditioner_.assemble(hessian_, meter_);
  scale_residual();
  step_scale_ = correction_scale_ = gradient_scale_ / energy_.scale();
  team_.for_ranges(unknowns_, kNumbersPerTask,
                   [&](std::size_t begin, std::size_t end) { std::fill_n(step_.data() + begin, end - begin, 0.0); });
  if (meter_ != nullptr) meter_->begin(Activity::Products);
  return energy_.value();
}

void MeshObjective::scale_residual() {
  gradient_scale_ = power_of_two(
      reduction_.largest(unknowns_, kNumbersPerTask, [&](std::size_t i) { return std::abs(gradient_[i]); }));
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) residual_[i] = static_cast<float>(-gradient_[i] / gradient_scale_);
  });
}

// ===== Conjugate gradients =====

double MeshObjective::multiply() {
  if (part_ != nullptr)
    part_->share.directions.exchange(direction_.data(), at(problem_.dimension), *part_->share.ranks);
  const double curvature = energy_.multiply(direction_, product_);
  if (meter_ != nullptr) meter_->add(1);
  return curvature;
}

void MeshObjective::advance(double alpha) {
  const auto alpha_float = static_cast<float>(alpha);
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      step_[i] += alpha * static_cast<double>(direction_[i]);
      residual_[i] -= alpha_float * product_[i];
    }
  });
}

void MeshObjective::turn(double beta) {
  if (beta == 0) {
    return shared_copy<float>(std::span(product_).first(unknowns_), std::span(direction_).first(unknowns_), team_);
  }
  const auto beta_float = static_cast<float>(beta);
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) direction_[i] = product_[i] + beta_float * direction_[i];
  });
}

void MeshObjective::take_direction() {
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    std::copy_n(direction_.data() + begin, end - begin, step_.data() + begin);
  });
}

// ===== Sizes =====

double MeshObjective::gradient_norm() {
  return std::sqrt(
      reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) { return gradient_[i] * gradient_[i]; }));
}

double MeshObjective::preconditioned_norm(double rq) const {
  return std::sqrt(std::max(0.0, rq)) * gradient_scale_ / std::sqrt(energy_.scale());
}

template <class Number>
double MeshObjective::largest_displacement(std::span<const Number> displacements) {
  const std::size_t d = at(problem_.dimension);
  return std::sqrt(reduction_.largest(own_nodes_, kNumbersPerTask / 4, [&](std::size_t rank) {
    double square = 0;
    for (std::size_t k = 0; k < d; ++k) {
      const auto component = static_cast<double>(displacements[rank * d + k]);
      square += component * component;
    }
    const double inverse_size = problem_.inverse_size[rank];
    return square * inverse_size * inverse_size;
  }));
}

double MeshObjective::largest_defect() {
  shared_copy<float>(residual_, std::span(direction_).first(unknowns_), team_);
  begin_assembly(energy_.gradient_work());
  energy_.gradient(gradient_);
  team_.for_ranges(unknowns_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) gradient_[i] += gradient_scale_ * static_cast<double>(direction_[i]);
  });
  scale_residual();
  preconditioner_.apply(residual_, product_);
  return largest_displacement<float>(product_) * (gradient_scale_ / energy_.scale());
}

// ===== The step =====

double MeshObjective::finish_step() {
  const double slope = reduction_.sum(unknowns_, kNumbersPerTask, [&](std::size_t i) {
    step_[i] *= step_scale_;
    return gradient_[i] * step_[i];
  });
  step_scale_ = 1;
  const std::size_t d = at(problem_.dimension);
  team_.for_ranges(own_nodes_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      std::copy_n(&problem_.positions[at(problem_.free[f]) * d], d, &gradient_[f * d]);
  });
  return slope;
}

double MeshObjective::noise() { return energy_.noise(); }

double MeshObjective::move(double alpha) {
  place(alpha, team_);
  energy_.scan();
  return energy_.value();
}

void MeshObjective::place(double alpha, const Team& team) {
  const std::size_t d = at(problem_.dimension);
  team.for_ranges(own_nodes_, kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t k = 0; k < d; ++k)
        problem_.positions[at(problem_.free[f]) * d + k] = gradient_[f * d + k] + alpha * step_[f * d + k];
  });
  if (part_ != nullptr) part_->share.positions.exchange(problem_.positions.data(), d, *part_->share.ranks);
}

}  // namespace varimesh
