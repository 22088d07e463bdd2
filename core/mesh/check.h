// Whether a mesh can be optimised at all; every refusal names the element or node and says what to do.
#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// What the checks found out on the way.
struct MeshCheck {
  bool clockwise = false;  ///< A 2-D mesh (or a 3-D one) whose elements are all numbered the other way round: accepted.
};

/// Checks what every later step relies on: there are elements of dimension 2 or 3, of one order and of known shapes;
/// all coordinates are finite; a 2-D mesh lies in a plane z = constant; each cell's nodes are distinct; no cell appears
/// twice; cells conform (a facet has one or two cells, which agree on its nodes); every straight-sided cell (its
/// vertices alone) has a positive Jacobian, or all of them a negative one.
/// Errors: BadInput, with the sentence for the first fault found, how many there are like it, and what to do.
Expected<MeshCheck> check(const HighOrderMesh& mesh);

/// The same but for the straight-sided cells: what judging a mesh relies on. An optimised mesh may have cells that are
/// inverted with straight sides, among those that cannot be repaired or where curved edges leave room.
Expected<void> check_to_judge(const HighOrderMesh& mesh);

}  // namespace varimesh
