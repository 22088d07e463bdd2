// The association of a mesh that has new nodes. Internal to core/curve.
#pragma once

#include <cstdint>
#include <vector>

#include "core/association/association.h"

namespace varimesh::detail {

/// What is known about the nodes that a mesh had before; all other nodes belong to nothing yet.
/// @param start               of the mesh before
/// @param surface_of_element  as Association has it, of the mesh now
/// @param before              by node of the mesh now: its index in the mesh before; −1: it is new
Association carry_over(const Association& start, const HighOrderMesh& mesh,
                       std::vector<std::vector<int>> surface_of_element, const std::vector<std::int32_t>& before);

}  // namespace varimesh::detail
