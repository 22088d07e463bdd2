// Makes elements around what cannot be repaired straight-sided, as far as the boundary and their neighbours allow.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// Makes those triangles and tetrahedra of these groups straight-sided that are not certified valid, and those that
/// share a facet with one. Nodes on their free edges go to equal parts of the straight line between its ends. Nodes on
/// their free faces and inside follow the edges and faces around them (core/mesh/changes/simplex_blend.h); if these are
/// straight, so is the element. Other cells around an edge or face that moves are carried along in the same way.
/// Vertices and fixed nodes stay bit for bit. docs/repair.md has the formulas.
///
/// No certificate is lost: if a cell would lose its own, its edges and faces stay as they are, and the others are tried
/// again. This ends, because fewer are left each time. If the team's token interrupts it, nothing has changed. `fixed`
/// is by node. `certificates` are those of mesh.coordinates on entry and again afterwards, one per cell in the mesh's
/// order. Call it inside team.run(). Returns what was done to each group, and what was left.
std::vector<RepairStep> straighten(HighOrderMesh& mesh, const std::vector<bool>& fixed, const Certifier& certifier,
                                   std::vector<Certificate>& certificates, std::span<const UnrepairableGroup> groups,
                                   const Team& team);

}  // namespace varimesh
