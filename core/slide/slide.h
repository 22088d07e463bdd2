// Slides the boundary nodes of a mesh on its geometry, bottom-up: curves first, then surfaces. Internal to the library.
#pragma once

#include <vector>

#include "core/association/association.h"
#include "core/options/geometry_options.h"
#include "core/slide/slide_report.h"

namespace varimesh {

/// Slides nodes until the elements on each curve and surface are as even as their straight-sided forms (core/slide's
/// energy; entity_energy.h has the formula). The elements inside the mesh are not looked at: the caller optimises them
/// afterwards with the boundary fixed. All nodes that move are on their entity afterwards, up to rounding. Vertices,
/// nodes of `fixed`, nodes at poles and nodes that belong to no entity for sure stay.
///
/// No curve and no surface is farther from its elements afterwards (largest and rms distance between the nodes), none
/// has more folded elements, and no node leaves its surface through the boundary. If the optimum would do so, the nodes
/// of an entity go only a half, a quarter or an eighth of the way, or stay. The nodes on a surface may make use of what
/// its curves have left: its distances may reach those at the start or, if these are larger, those after the curves'
/// nodes have moved. If a surface is then worse than at the start, the nodes of its curves go back, and the surfaces
/// around try again.
///
/// If the mesh lies in a plane, nodes slide on its curves, and the report has the distances from these.
///
/// Periodic links of the mesh hold afterwards as they did before: where the nodes of a link would part, they stay.
///
/// The result does not depend on the number of threads. Call it inside team.run().
SlideReport slide(HighOrderMesh& mesh, Association& association, SlideOn what, const std::vector<bool>& fixed,
                  const Team& team);

}  // namespace varimesh
