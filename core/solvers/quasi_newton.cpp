#include "core/solvers/quasi_newton.h"

#include <algorithm>
#include <cmath>

#include "core/solvers/line_search.h"

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 4096;

}  // namespace

QuasiNewtonOutcome QuasiNewton::minimise(Smooth& objective, const QuasiNewtonRules& rules) {
  QuasiNewtonOutcome outcome;
  forget();
  double value = objective.evaluate(gradient_);
  if (!std::isfinite(value)) return outcome;
  outcome.first_gradient = std::sqrt(dot(gradient_, gradient_));
  while (outcome.steps < rules.most_steps) {
    double slope = direction(objective);
    if (!(slope < 0)) {
      forget();
      slope = direction(objective);
    }
    if (!(slope < 0) || -slope <= rules.little * value) break;
    objective.mark();
    const AcceptedStep accepted = backtrack({value, slope, rules.noise * value, rules.most_trials}, [&](double alpha) {
      objective.move(alpha, step_);
      return objective.evaluate(next_);
    });
    if (accepted.alpha == 0) {
      objective.move(0, step_);
      break;
    }
    ++outcome.steps;
    outcome.residual = accepted.alpha * objective.largest(step_);
    for (std::size_t i = 0; i < step_.size(); ++i) {
      step_[i] *= accepted.alpha;
      work_[i] = next_[i] - gradient_[i];
    }
    note(objective);
    gradient_.swap(next_);
    value = accepted.energy;
  }
  outcome.last_gradient = std::sqrt(dot(gradient_, gradient_));
  return outcome;
}

double QuasiNewton::dot(std::span<const double> a, std::span<const double> b) {
  return reduction_.sum(a.size(), kNumbersPerTask, [&](std::size_t i) { return a[i] * b[i]; });
}

void QuasiNewton::add(double factor, std::span<const double> from, std::span<double> to) {
  team_.for_ranges(to.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) to[i] += factor * from[i];
  });
}

void QuasiNewton::note(Smooth& objective) {
  const double curvature = dot(step_, work_);
  if (!(curvature > 0)) return;
  if (pairs_.empty()) {  // all at once, so that the memory of a run does not depend on how many steps it takes
    pairs_.resize(kPairs);
    for (Pair& one : pairs_) {
      one.step.resize(step_.size());
      one.change.resize(step_.size());
    }
  }
  newest_ = (newest_ + 1) % kPairs;
  used_ = std::min(used_ + 1, kPairs);
  Pair& added = pair(0);
  added.step = step_;
  added.change = work_;
  added.curvature = curvature;
  if (used_ > 1) return;
  scaled_.resize(step_.size());
  objective.precondition(work_, scaled_);
  scale_ = curvature / dot(work_, scaled_);
}

double QuasiNewton::direction(Smooth& objective) {
  std::ranges::copy(gradient_, work_.begin());
  for (std::size_t age = 0; age < used_; ++age) {
    Pair& one = pair(age);
    one.alpha = dot(one.step, work_) / one.curvature;
    add(-one.alpha, one.change, work_);
  }
  objective.precondition(work_, step_);
  for (double& number : step_) number *= scale_;
  for (std::size_t age = used_; age-- > 0;) {
    const Pair& one = pair(age);
    add(one.alpha - dot(one.change, step_) / one.curvature, one.step, step_);
  }
  team_.for_ranges(step_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) step_[i] = -step_[i];
  });
  return dot(gradient_, step_);
}

}  // namespace varimesh
