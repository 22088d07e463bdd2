// Whether a mesh is curved at all.
#pragma once

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Whether all nodes of all cells lie where the straight-sided cell on the same vertices has them, to within 1e-9 of
/// the diagonal of the mesh's bounding box. This is more than the rounding errors of files with ten digits. Call it
/// inside team.run().
bool has_straight_sides(const HighOrderMesh& mesh, const Team& team = Team(1));

}  // namespace varimesh
