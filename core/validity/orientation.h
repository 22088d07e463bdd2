// Whether a mesh is numbered counter-clockwise or clockwise. Internal to the library.
#pragma once

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// −1 if most straight-sided cells have a negative Jacobian at their centre, else 1. Call it inside team.run().
double orientation(const HighOrderMesh& mesh, const Team& team = Team(1));

}  // namespace varimesh::detail
