// What a checkpoint keeps of an iteration.
#pragma once

#include "core/optimise/iteration.h"

namespace varimesh {

/// All but groups_left, which only several runs together have, and seconds_left, which depends on the machine.
template <class Archive>
void iteration_state(Archive& archive, Iteration& i) {
  archive(i.phase, i.number, i.energy, i.residual, i.relative_gradient, i.min_scaled_jacobian, i.invalid_elements,
          i.repairable_elements, i.left_elements, i.active_nodes, i.products, i.linear_solve, i.on_device, i.seconds);
}

}  // namespace varimesh
