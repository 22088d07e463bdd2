// Edges at which two sides of the boundary touch.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/association/association.h"
#include "core/curve/parts.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/split.h"
#include "core/repair/split_rules.h"

namespace varimesh {

/// An edge that lies on two surfaces of the geometry, where the mesh of each surface has elements on both sides of the
/// edge. A coarse mesh has such edges across holes: both sides of the hole have an edge with the same ends, and a mesh
/// has only one of these. So its nodes cannot lie on both surfaces. If each side gets a vertex of its own between the
/// ends, the sides part.
struct PinchedEdge {
  struct Side {
    int surface = -1;                      ///< Index in Association::geometry.surfaces.
    int entity = 0;                        ///< The mesh's entity of the elements on this side.
    std::array<std::int32_t, 2> apexes{};  ///< The third vertices of the two surface elements.
    std::vector<std::int32_t> beside;      ///< The other vertices of all elements on this side, as split() takes them.
  };
  std::array<Side, 2> sides;
};

/// The pinched edges of a mesh of tetrahedra, if its cells lie outside the gap between the two sides. An edge on which
/// an element of dimension 1 lies does not count.
/// @param parts  of the mesh
std::map<SplitPlace, PinchedEdge> pinched_edges(const HighOrderMesh& mesh, const Association& association,
                                                const detail::MeshParts& parts, const Cells& cells,
                                                const SplitRules& rules);

/// At each of the places that is pinched, gives the elements on the second side nodes of their own between the ends of
/// the edge, where the first side's are, so that the sides have only the ends in common. They come last in the mesh.
/// Goes through the elements once, however many edges there are.
void part_nodes(HighOrderMesh& mesh, std::span<const SplitPlace> places,
                const std::map<SplitPlace, PinchedEdge>& pinched);

}  // namespace varimesh
