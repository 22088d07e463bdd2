// Swaps edges on the boundary for others, with new nodes on the geometry.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// A tetrahedron with two faces on one smooth surface has no room along their common edge, however its nodes move: the
/// faces meet at 180° there. For each wanted tetrahedron with just two faces on the boundary, which lie on one surface
/// of the geometry and meet inside it, this takes the tetrahedron out of the mesh. Its other two faces are on the
/// boundary then, and their common edge takes the place of the old one. So the mesh conforms, and has fewer cells. The
/// nodes of the new edge and faces go to the surface (core/curve/refined.h). If other cells have the old edge, too, its
/// nodes are placed anew: on a coarse mesh, it may be an edge of faces on two sides of a body.
///
/// An edge stays if an element of dimension 1 has it, if it lies on a periodic boundary or has held nodes, if the faces
/// belong to different entities of the mesh, if the new edge is on the boundary already, if it would leave the four
/// edges around both faces, if these go round more than half of a thin part, or if one more cell would have two faces
/// on the surface then. Of cells that share a face or have one neighbour, only the first is taken out.
///
/// Adds a step to `steps` for each edge. `association` is that of the mesh, before and afterwards. The result does not
/// depend on the number of threads. Call it inside team.run().
/// @param wanted    numbers of cells, in ascending order
/// @param held      by node: whether it stays; may be empty
/// @param surfaces  receives the surfaces of the geometry, as Surface::number_text()
/// @return how many edges were swapped; if it is 0, nothing has changed
std::size_t swap_boundary_edges(HighOrderMesh& mesh, Association& association, std::span<const std::int64_t> wanted,
                                const std::vector<bool>& held, std::vector<RepairStep>& steps,
                                std::set<std::string>& surfaces, const Team& team);

}  // namespace varimesh
