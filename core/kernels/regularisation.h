// δ of the regularised Jacobian J' = (J + √(J² + δ²))/2: how it is chosen for each cell.
#pragma once

#include <cstdint>

#include "core/problem/problem.h"

namespace varimesh {

/// δ² for a cell, or the star of a node, whose smallest J is `smallest`: 0 if that is positive, else (0.4 J)² + 4e-8,
/// as in the reference implementation. So δ goes to zero as the mesh becomes valid. Dimensionless.
inline double delta_squared_for(double smallest) { return smallest > 0 ? 0.0 : 4e-8 + 0.16 * smallest * smallest; }

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
