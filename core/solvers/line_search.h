// The line search of the sweeps, of Newton's method and of the untangling: how much of a step to take.
#pragma once

namespace varimesh {

/// What a line search starts from.
struct LineSearch {
  double energy = 0;       ///< At the start, E(0).
  double slope = 0;        ///< Derivative of the energy along the full step, negative.
  double noise = 0;        ///< A change of the energy by no more than this is rounding.
  int trials = 0;          ///< At most this many steps are tried.
  double decrease = 1e-4;  ///< c of Armijo's condition.
};

/// The step that a line search accepted.
struct AcceptedStep {
  double alpha = 0;   ///< Share of the full step; 0: no step was accepted.
  double energy = 0;  ///< There. If no step was accepted, the energy of the last trial.
};

/// Backtracks from the full step: tries α = 1, 1/2, 1/4, … and accepts the first that meets the condition of Armijo,
///     E(α) ≤ E(0) + c α slope
/// (J. Nocedal, S. J. Wright, Numerical Optimization, 2nd edition, 2006, algorithm 3.1). If the slope itself is below
/// the noise, the predicted decrease is lost in rounding, and a step that raises the energy by no more than the noise
/// is accepted too.
///
/// @param energy_at double energy_at(double alpha); +∞ or NaN: the step is not allowed. It is called for each trial in
///        turn, the last time for the step that is returned
template <class EnergyAt>
AcceptedStep backtrack(const LineSearch& start, const EnergyAt& energy_at) {
  AcceptedStep step;
  double alpha = 1;
  for (int trial = 0; trial < start.trials; ++trial, alpha *= 0.5) {
    step.energy = energy_at(alpha);
    const bool lower = step.energy <= start.energy + start.decrease * alpha * start.slope;
    const bool lost_in_rounding = -start.slope < start.noise && step.energy <= start.energy + start.noise;
    if (!lower && !lost_in_rounding) continue;
    step.alpha = alpha;
    return step;
  }
  return step;
}

}  // namespace varimesh
