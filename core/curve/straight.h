// Boundary elements that stay straight where the boundary is curved. Internal to core/curve.
#pragma once

#include <cstdint>

#include "core/association/association.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// How many surface elements have a new node that belongs to no entity, although the boundary is curved there: it turns
/// a little from one such element to the next, as it does around a cylinder. Where it is flat or has an edge, as a box
/// has, elements do not count. Vertices do not count either: they stay where the mesh had them. In a plane, the same
/// holds of edges at which elements end.
std::int64_t count_straight_elements(const HighOrderMesh& mesh, const Association& association);

}  // namespace varimesh::detail
