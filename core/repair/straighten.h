// Elements beside what cannot be repaired made straight-sided, where the boundary and their neighbours allow it.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// Makes straight-sided the triangles and tetrahedra of these groups that are not certified valid, and those that share
/// a facet with one: nodes on their free edges go to equal parts of the straight line, nodes on their free faces and
/// inside to where the edges (and faces) round them say, which is the straight-sided place where these are straight.
/// Other cells round an edge or face that moves are carried along in the same way. Vertices and fixed nodes stay, bit
/// for bit.
///
/// No certificate is lost: where a cell that is certified valid would not be any more, its edges and faces stay as they
/// are, and the rest is tried again; this ends, since each time fewer are left. `certificates` are of mesh.coordinates,
/// and are so again afterwards. Call it inside team.run(). Returns a step for each group.
std::vector<RepairStep> straighten(HighOrderMesh& mesh, const std::vector<bool>& fixed, const Certifier& certifier,
                                   std::vector<Certificate>& certificates, std::span<const UnrepairableGroup> groups,
                                   const Team& team);

}  // namespace varimesh
