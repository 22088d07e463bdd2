// δ of the regularised Jacobian J' = (J + √(J² + δ²))/2: how every method of the core chooses it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/problem/problem.h"

namespace varimesh {

/// δ² for a cell, or the star of a node, whose smallest J is `smallest`: 0 if that is positive, else (0.4 J)² + 4e-8,
/// as in the reference implementation. So δ goes to zero as the mesh becomes valid. Dimensionless.
inline double delta_squared_for(double smallest) { return smallest > 0 ? 0.0 : 4e-8 + 0.16 * smallest * smallest; }

/// δ of all elements together in a step of boundary sliding, while one of them is folded: 0.5 · falls^step. Once none
/// is, δ is 0.
inline double falling_delta(int step, double falls) { return 0.5 * std::pow(falls, step); }
/// How fast it falls. If a fold stays, a second attempt has another rate: a fold may open at one that stays at the
/// other, and neither is the better one on all meshes. Elements of one curve or surface try the slow one, all together
/// the fast one.
inline constexpr double kDeltaFalls = 0.85, kDeltaFallsSlowly = 0.9, kDeltaFallsFast = 0.7;

inline constexpr double kLeastEpsilon = 1e-10;
/// The next ε of untangling: χ(D, ε) = (D + √(D² + ε²))/2 takes the place of J there, with D the smallest Bernstein
/// coefficient. By the schedule of V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov,
/// Foldover-free maps in 50 lines of code, ACM Trans. Graph. 40, 2021. With E₀, E₁ the energies before and after the
/// step at its ε,
///
///     σ = max(0.3, 1 − E₁/E₀),   m = (1 − σ) χ(D, ε),   ε ← 2 √(m (m − D)) if D ≤ m, else 1e-10.
///
/// χ(D, ε) then becomes m: the barrier moves closer in proportion to the decrease of the energy.
/// @param chi  χ(D, ε)
inline double next_epsilon(double smallest, double chi, double before, double after) {
  const double sigma = std::max(0.3, 1 - after / before);
  const double m = (1 - sigma) * chi;
  return smallest <= m ? std::max(2 * std::sqrt(m * (m - smallest)), kLeastEpsilon) : kLeastEpsilon;
}
/// The first ε.
inline double first_epsilon(double smallest) { return std::max(0.2 * std::abs(smallest), kLeastEpsilon); }

/// δ² of an unrepairable cell. J is about 1 in a good cell, so with δ = 1 the energy's slope is mild for every J: the
/// cell keeps a shape and does not press on its neighbours.
inline constexpr double kUnrepairableDeltaSquared = 1;

inline bool is_unrepairable(const CellSet& set, std::int32_t cell) {
  return !set.unrepairable.empty() && set.unrepairable[static_cast<std::size_t>(cell)] != 0;
}

/// δ² of a cell whose smallest J is `smallest`.
inline double delta_squared_of(const CellSet& set, std::int32_t cell, double smallest) {
  return is_unrepairable(set, cell) ? kUnrepairableDeltaSquared : delta_squared_for(smallest);
}

}  // namespace varimesh
