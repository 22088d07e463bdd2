// A curved mesh whose edges were split gets its new nodes onto the geometry.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The vertex at which an edge was split.
struct NewVertex {
  std::int32_t node = -1;
  std::array<std::int32_t, 2> ends{};  ///< The ends of the edge.
};

/// Places the nodes that were added with new vertices as core/curve/curve.h places the new nodes of a straight mesh:
/// new vertices at the middle of their edge on its curve or surface, and the nodes of edges and faces with a new vertex
/// between their vertices. Nodes inside cells with a new vertex are blended from those around. All other nodes stay. So
/// it does not matter whether the edges that were split had folded elements.
///
/// All cells with a new vertex are triangles or tetrahedra.
/// @param association         the association of the mesh before it was split; becomes the association of `mesh`
/// @param surface_of_element  as Association has it, of `mesh`
/// Call it inside team.run().
void place_refined(HighOrderMesh& mesh, Association& association, std::vector<std::vector<int>> surface_of_element,
                   std::span<const NewVertex> vertices, const Team& team);

/// Puts the nodes that lie between both ends of one of the edges, and maybe other vertices, to where a straight mesh
/// would have them: on edges and faces of the boundary on the geometry, inside the mesh blended from those around. All
/// other nodes stay.
/// @param association         the association of the mesh before; becomes the association of `mesh`
/// @param surface_of_element  as Association has it, of `mesh`
/// @param before              by node of `mesh`: its index in the mesh before
/// @param edges               the ends of each edge, the lower index first
/// Call it inside team.run().
void place_edges_anew(HighOrderMesh& mesh, Association& association, std::vector<std::vector<int>> surface_of_element,
                      const std::vector<std::int32_t>& before, std::span<const std::array<std::int32_t, 2>> edges,
                      const Team& team);

}  // namespace varimesh
