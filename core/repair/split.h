// Interior edges and faces of tetrahedra split in two and in three, without a change of shape.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// An edge or a face of tetrahedra, by the indices of its vertices, in ascending order; of an edge the third is −1.
using SplitPlace = std::array<std::int32_t, 3>;

/// Splits each edge into two and each face into three, and with it every tetrahedron that it bounds: each of these
/// becomes as many, by putting the new vertex in the place of one of the edge's or face's.
///
/// The new vertex is put where the tetrahedra have the edge's midpoint or the face's centroid, and all other nodes of
/// the parts where the polynomial that was there has them: no shape changes. Nodes that parts share are found by their
/// vertices and place between them, so the mesh conforms. Nodes of what is not split stay, bit for bit. Numbers stay,
/// too: where a node's edge, face or cell is gone, its number is given to a new one; the further new nodes are numbered
/// above the highest there is and come last, the new elements likewise within their block, in the same entities and
/// physical groups.
///
/// Adds a step to `steps` for each place.
///
/// Every place has to be inside the mesh, with nothing but tetrahedra of the mesh's order round it and no element of a
/// lower dimension on it, and no two may share a tetrahedron.
HighOrderMesh split(const HighOrderMesh& mesh, std::span<const SplitPlace> places, std::vector<RepairStep>& steps);

}  // namespace varimesh
