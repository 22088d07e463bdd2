// What a rank owns of the maps of one order on the cells of a mesh.
#pragma once

#include <cstdint>
#include <span>

#include "core/solvers/descent/form/order_space.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// Completes a space on part.problem whose places, numbers and lists are set: how many nodes are the rank's own, which
/// places are first, the order of places, and the halos.
/// @param stand_ins  by node of the space: a place in part.problem.free, ascending. The node and its stand-in lie in
/// the same vertex, edge, face or cell, so they have the same cells, the same first cell, and the same owner.
void share_space(const ProblemPart& part, std::span<const std::int32_t> stand_ins, OrderSpace& space);

}  // namespace varimesh
