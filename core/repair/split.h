// Splits edges and faces of tetrahedra and triangles without a change of shape.
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

/// By block of the mesh: the index of the parent of each new element, in their order.
using SplitParents = std::vector<std::vector<std::size_t>>;

/// Splits each edge in two and each face in three, and with it every line, triangle and tetrahedron that it bounds. A
/// part of an element has the new vertex in place of one of the edge's or face's vertices.
///
/// The new vertex lies at the edge's midpoint or the face's centroid as the curved elements have it. The parent's
/// polynomial gives all other nodes of the parts, so no shape changes. Nodes that parts share are found by their
/// vertices and their place between them, so the mesh conforms. Nodes of everything that is not split stay bit for bit.
///
/// Numbers stay, too. If a node's edge, face or cell disappears, its number is given to a new node of the same entity.
/// Further new nodes get numbers above the highest there is and come last. New elements also come last within their
/// block, in the same entities and physical groups.
///
/// Adds a step to `steps` for each place; it names cells only.
///
/// Requirements: all elements around every place are simplices of the mesh's order, at least one of them a cell, and no
/// two places share a cell.
/// @param parents  if not null, receives where the new elements come from
/// @param beside   empty; or by place, empty or in any order: the other vertices of the elements that are split. Those
///                 that have others stay. The nodes on the place belong to the former alone.
HighOrderMesh split(const HighOrderMesh& mesh, std::span<const SplitPlace> places, std::vector<RepairStep>& steps,
                    SplitParents* parents = nullptr, std::span<const std::vector<std::int32_t>> beside = {});

}  // namespace varimesh
