// Newton's method: truncated Newton steps with conjugate gradients and a line search.
#pragma once

#include "core/solvers/conjugate_gradients.h"
#include "core/solvers/minimised.h"
#include "core/solvers/ritz_values.h"

namespace varimesh {

/// How Newton's method solves its linear systems and takes its steps.
struct NewtonRules {
  /// Products of H and a direction per linear system, at most. 0: M is H, and M⁻¹ r is the step.
  int most_products = 0;
  /// The share of its initial residual to which a system is solved, in the norm of M⁻¹. 0: it is smaller the faster the
  /// gradient falls (S. C. Eisenstat, H. F. Walker, SIAM J. Sci. Comput. 17, 1996).
  double forcing = 0;
  /// The residual at which the run will end. Steps are solved as tightly as is useful to get there. 0: the forcing term
  /// alone decides.
  double tolerance = 0;
  /// If a direction among so many has no positive curvature, the step is solved with a convex part of H.
  int few_products = 0;
  /// If a line search takes less than this share of a step that ended in a direction without positive curvature, the
  /// steps after it are solved with a convex part of H from the beginning.
  double convex_below = 0;
  int most_trials = 30;    ///< Of a line search.
  double decrease = 1e-4;  ///< LineSearch::decrease.
  int most_doublings = 0;  ///< Of a step that was taken as a whole, as long as the objective falls.
};

/// What one Newton step did. Displacements are relative to the size of the cells around the node.
struct NewtonOutcome {
  double before = 0;         ///< The objective at the start of the step.
  double after = 0;          ///< At its end. The same as before if no step was taken.
  double residual = 0;       ///< Largest displacement of a node in the full step, before the line search.
  double gradient_norm = 0;  ///< √ Σ |G|² at the start of the step.
  double damping = 0;        ///< Share of the full step that was taken; 0: no step lowered the objective.
  bool failed = false;       ///< The step is not finite, or it is 0 although the gradient is not.
  /// Whether every node is within the tolerance of the optimum: the residual is within it, the linear system was solved
  /// far enough, and the gradient after the step agrees.
  bool converged = false;
  LinearSolve linear_solve = LinearSolve::None;
  int products = 0;  ///< Products of the Hessian and a direction.
};

/// Newton steps on an objective. If conjugate gradients meet a direction of negative curvature, they stop with the step
/// that they have, or the step is solved again with a convex part of the Hessian. The line search backtracks from the
/// full step (line_search.h). It raises the objective by no more than rounding.
class NewtonMethod {
 public:
  NewtonMethod(Minimised& objective, const NewtonRules& rules) : objective_(objective), rules_(rules) {}
  /// Goes on where another method was, with the same unknowns in another objective, which has no preconditioner yet.
  NewtonMethod(Minimised& objective, const NewtonMethod& before)
      : objective_(objective),
        rules_(before.rules_),
        rough_(before.rough_),
        last_gradient_(before.last_gradient_),
        spectrum_(before.spectrum_),
        begins_convex_(before.begins_convex_) {}

  /// From now on a linear system is solved only to a tenth of its initial residual, with at most this many products.
  void solve_roughly(int most_products) {
    rough_ = true;
    rules_.most_products = most_products;
  }

  /// If the team's token interrupts it, the unknowns are where they were before, or where the step has put them.
  NewtonOutcome step();

  /// Whether the next step makes the preconditioner anew.
  bool renews() const { return renews_; }

  /// Reads or writes what a step leaves for the next.
  template <class Archive>
  void state(Archive& archive) {
    archive(last_gradient_, renews_, begins_convex_, products_when_new_);
    spectrum_.state(archive);
  }

 private:
  struct LinearSystem;
  /// Solves H x = −g with conjugate gradients, up to the forcing term or as the tolerance requires.
  void solve(NewtonOutcome& outcome);
  /// Whether conjugate gradients may stop. `share`: of the initial residual, what is left.
  bool is_solved(double share);
  /// An estimate of how far a node is from the solution of the linear system, relative to the size of the cells around
  /// it, from q = M⁻¹ r; +∞ if the spectrum is not known yet. `step`: the residual of the step.
  ///
  /// Two bounds hold in the norm of M, and the smaller one is taken for the node that is farthest away: M⁻¹ r divided
  /// by the smallest eigenvalue of M⁻¹H, and what conjugate gradients must have reduced the error to after this many
  /// products.
  double distance_left(double step);
  /// How far a node is from the optimum because the linear residual and the gradient differ: the residual is carried
  /// along with few digits, and the objective is not quadratic.
  double defect() { return objective_.largest_defect() / spectrum_.estimate(ritz_).smallest; }
  /// Moves the unknowns by a share of the step, and sets what the outcome says of it.
  void search(double slope, NewtonOutcome& outcome);

  Minimised& objective_;
  NewtonRules rules_;
  bool rough_ = false;         ///< See solve_roughly().
  double forcing_ = 0;         ///< Of the present step.
  double last_gradient_ = 0;   ///< Gradient of the step before, in the preconditioner's norm.
  RitzValues ritz_;            ///< Of the last solve.
  SpectrumEstimate spectrum_;  ///< Of M⁻¹H.
  bool renews_ = true;
  bool begins_convex_ = false;  ///< See NewtonRules::convex_below.
  int products_when_new_ = 0;   ///< Products of the first step with the present preconditioner.
};

}  // namespace varimesh
