// Splits interior edges and faces of tetrahedra without a change of shape.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// An edge or a face of tetrahedra, by the indices of its vertices in ascending order. The third of an edge is −1.
using SplitPlace = std::array<std::int32_t, 3>;

inline SplitPlace edge_place(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b), -1}; }
inline SplitPlace face_place(std::int32_t a, std::int32_t b, std::int32_t c) {
  SplitPlace place{a, b, c};
  std::ranges::sort(place);
  return place;
}
inline int vertex_count(const SplitPlace& place) { return place[2] < 0 ? 2 : 3; }

/// Splits each edge in two and each face in three, and with it every tetrahedron that it bounds. A part of a
/// tetrahedron has the new vertex in place of one of the edge's or face's vertices.
///
/// The new vertex lies at the edge's midpoint or the face's centroid as the curved tetrahedra have it. The parent's
/// polynomial gives all other nodes of the parts, so no shape changes. Nodes that parts share are found by their
/// vertices and their place between them, so the mesh conforms. Nodes of everything that is not split stay bit for bit.
///
/// Numbers stay, too. If a node's edge, face or cell disappears, its number is given to a new node. Further new nodes
/// get numbers above the highest there is and come last. New elements likewise come last within their block, in the
/// same entities and physical groups.
///
/// Adds a step to `steps` for each place.
///
/// Requirements: every place is inside the mesh, all elements around it are tetrahedra of the mesh's order, no element
/// of a lower dimension lies on it, and no two places share a tetrahedron.
HighOrderMesh split(const HighOrderMesh& mesh, std::span<const SplitPlace> places, std::vector<RepairStep>& steps);

}  // namespace varimesh
