#include "core/solvers/newton_method.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/stop_token.h"
#include "core/solvers/line_search.h"

namespace varimesh {
namespace {

constexpr double kLargeStep = 0.05;  // of a cell's size: after a larger step the preconditioner is made anew
constexpr double kRough = 0.1;       // even the last step is solved to this share of its initial residual,
constexpr double kFinest = 1e-3;     // and no step is solved beyond this one
constexpr double kCurved = 0.3;      // of the tolerance: a larger square of the step shows in the next one

/// The forcing term of Eisenstat and Walker. Gradients are in the preconditioner's norm.
double forcing_term(double gradient, double last) {
  if (!(last > 0)) return 0.1;
  return std::min(0.1, std::max(0.01, 0.9 * std::pow(gradient / last, 1.5)));
}

}  // namespace

NewtonOutcome NewtonMethod::step() {
  NewtonOutcome outcome;
  outcome.before = outcome.after = objective_.linearise(renews_);
  outcome.gradient_norm = objective_.gradient_norm();
  if (begins_convex_) objective_.make_convex();
  solve(outcome);
  if (outcome.linear_solve == LinearSolve::NegativeCurvature && outcome.products <= rules_.few_products &&
      objective_.make_convex())
    solve(outcome);
  if (renews_) products_when_new_ = outcome.products;
  const double slope = objective_.finish_step();
  outcome.residual = objective_.largest_step();
  outcome.failed = !std::isfinite(slope) || (outcome.residual == 0 && outcome.gradient_norm > 0);
  const bool may_converge = rules_.tolerance > 0 && !outcome.failed && outcome.linear_solve == LinearSolve::Solved;
  const double left = may_converge ? distance_left(outcome.residual) : 0;
  if (slope < 0 && !outcome.failed) search(slope, outcome);
  // If no step was taken, the unknowns are still where the step and what is left of it were measured.
  outcome.converged = may_converge && outcome.residual + left <= rules_.tolerance &&
                      (outcome.damping == 0 || left + defect() <= rules_.tolerance);
  if (outcome.linear_solve == LinearSolve::NegativeCurvature) begins_convex_ = outcome.damping < rules_.convex_below;
  // The preconditioner is used again as long as the unknowns hardly change.
  renews_ = outcome.damping < 1 || outcome.residual > kLargeStep || outcome.products > 2 * products_when_new_ + 20;
  return outcome;
}

// ===== The linear system =====

/// The vectors of conjugate gradients on H x = −g, for conjugate_gradients(): H p and then z are in q.
struct NewtonMethod::LinearSystem {
  NewtonMethod& method;
  double initial;  ///< g · M⁻¹ g, in the scale of r.

  double multiply() { return method.objective_.multiply(); }
  void advance(double alpha) {
    method.ritz_.advance(alpha);
    method.objective_.advance(alpha);
  }
  double precondition() { return method.objective_.precondition(); }
  bool is_solved(double rz) { return method.is_solved(std::sqrt(rz / initial)); }
  void turn(double beta) {
    method.ritz_.turn(beta);
    method.objective_.turn(beta);
  }
};

void NewtonMethod::solve(NewtonOutcome& outcome) {
  const double initial = objective_.precondition();
  const double norm = objective_.preconditioned_norm(initial);
  forcing_ = rules_.forcing > 0 ? rules_.forcing : forcing_term(norm, last_gradient_);
  last_gradient_ = norm;
  objective_.turn(0);
  if (rules_.most_products == 0) {
    objective_.take_direction();
    outcome.linear_solve = LinearSolve::Solved;
    return;
  }
  ritz_.clear();
  LinearSystem system{*this, initial};
  const ConjugateGradients result = conjugate_gradients(system, initial, rules_.most_products);
  spectrum_.note(ritz_);
  outcome.products += result.products;
  const bool reached_most = result.products == rules_.most_products && !result.solved;
  outcome.linear_solve = result.negative_curvature ? LinearSolve::NegativeCurvature
                         : reached_most            ? LinearSolve::MostProducts
                                                   : LinearSolve::Solved;
  // The quadratic model is not bounded below. The step is what was found so far, or the first direction.
  if (result.negative_curvature && result.products == 1) objective_.take_direction();
}

bool NewtonMethod::is_solved(double share) {
  if (rough_) return share <= kRough;
  if (rules_.tolerance == 0) return share <= forcing_;
  if (share > kRough) return false;
  const double step = objective_.largest_step();
  if (step <= rules_.tolerance) {
    const double left = distance_left(step);
    // The last step need not be solved further once it is known to be the last.
    if (step + left <= rules_.tolerance) return true;
    if (std::isinf(left)) return false;  // only more products can tell
  }
  if (share > forcing_) return false;
  // `left` is what the next step would have to do. If it is just above the tolerance, a few more products save a step,
  // unless the curvature of the energy, which is about the square of the step, takes the next step above it anyway.
  const double left = share * step;
  return step * step > kCurved * rules_.tolerance || left <= 0.7 * rules_.tolerance || left > 5 * rules_.tolerance ||
         share <= kFinest;
}

double NewtonMethod::distance_left(double step) {
  const double residual = objective_.largest_correction();
  if (residual == 0) return 0;
  const Spectrum spectrum = spectrum_.estimate(ritz_);
  if (!(spectrum.smallest > 0)) return std::numeric_limits<double>::infinity();
  const double any = residual / spectrum.smallest, reduction = spectrum.reduction(ritz_.count());
  return reduction < 1 ? std::min(any, step * reduction / (1 - reduction)) : any;
}

// ===== The line search =====

void NewtonMethod::search(double slope, NewtonOutcome& outcome) {
  // Where the objective is infinite, no step can be judged: computed again, rounding may turn over a cell that is about
  // to vanish.
  if (!std::isfinite(outcome.before)) return;
  try {
    AcceptedStep accepted = backtrack({outcome.before, slope, objective_.noise(), rules_.most_trials, rules_.decrease},
                                      [&](double alpha) { return objective_.move(alpha); });
    bool is_there = accepted.alpha > 0;
    for (int doubling = 0; doubling < rules_.most_doublings && accepted.alpha >= 1 && is_there; ++doubling) {
      const double further = objective_.move(2 * accepted.alpha);
      is_there = further < accepted.energy;
      if (is_there) accepted = {2 * accepted.alpha, further};
    }
    if (!is_there) objective_.move(accepted.alpha);
    if (accepted.alpha == 0) return;
    objective_.settle();
    outcome.damping = accepted.alpha;
    outcome.after = accepted.energy;
  } catch (const Interrupted&) {
    objective_.go_back();
    throw;
  }
}

}  // namespace varimesh
