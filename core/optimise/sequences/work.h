// How much work an iteration is, from what it counts: the same on every machine. Internal to core/optimise.
#pragma once

#include "core/optimise/iteration.h"

namespace varimesh {

/// Of an iteration or of a run: at least this much, a fraction of a second, may always be spent on trying something.
inline constexpr double kLeastWork = 3e5;

/// The work of an iteration. The unit is the visit of a node by a sweep. Measured on tetrahedra of order 3.
inline double work_of(const Iteration& iteration) {
  constexpr double kNewtonWork = 4, kProductWork = 0.1, kUntanglingWork = 80;  // per free node that is visited
  const auto nodes = static_cast<double>(iteration.active_nodes);
  if (iteration.phase == Phase::Sweeps) return nodes;
  if (iteration.phase == Phase::Untangle) return kUntanglingWork * nodes;
  return nodes * (kNewtonWork + kProductWork * iteration.products);
}

}  // namespace varimesh
