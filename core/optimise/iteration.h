// What is known after one iteration of a run: plain data.
#pragma once

#include <cstdint>

#include "core/solvers/conjugate_gradients.h"

namespace varimesh {

/// What part of the method an iteration belongs to.
enum class Phase : std::uint8_t { Sweeps, Newton, Untangle, Accuracy };

/// What is known after an iteration: a sweep, a Newton step, a step of untangling (at most three Newton steps in every
/// patch), or a round of the descent to the least loss of accuracy (core/solvers/descent/descent.h). All numbers but
/// the seconds are dimensionless.
struct Iteration {
  Phase phase = Phase::Sweeps;
  int number = 0;                     ///< 1, 2, … through the whole run.
  double energy = 0;                  ///< Σ ∫ W(F) |det ∇χ_L| dξ divided by Σ ∫ |det ∇χ_L| dξ.
  double residual = 0;                ///< Largest displacement of a node in the full step, before damping, divided by
                                      ///< the smallest size of a cell around the node (core/problem/sizes.h).
  double relative_gradient = 0;       ///< Norm of the energy's gradient relative to that of the first iteration.
  double min_scaled_jacobian = 0;     ///< At the quadrature points; cheaper than the quality report's, never below it.
  std::int64_t invalid_elements = 0;  ///< Cells that are not certified valid. While all cells are valid, only every
                                      ///< fourth sweep updates this.
  std::int64_t repairable_elements = 0;  ///< Those of them that are not unrepairable.
  std::int64_t left_elements = 0;        ///< Cells that would not be certified valid if the run ended here.
  std::int64_t active_nodes = 0;         ///< Free nodes visited.
  int products = 0;                      ///< Products of the Hessian and a vector: conjugate-gradient iterations, in
                                         ///< Phase::Accuracy too.
  LinearSolve linear_solve = LinearSolve::None;  ///< How these iterations ended.
  bool on_device = false;  ///< A device has made it, or steps of it: of a run with Options::device.
  double seconds = 0;      ///< Since the optimisation began.
  /// Groups of tetrahedra without room that the last look for splits has found; −1 before any look.
  std::int64_t groups_left = -1;
  double seconds_left = -1;  ///< Until the end of the run, as an estimate; −1 if it cannot be told.
};

}  // namespace varimesh
