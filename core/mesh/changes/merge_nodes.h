// Joins nodes that lie at the same place.
#pragma once

#include <cstddef>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Joins all nodes of elements that are at most `tolerance` apart, in the mesh's unit of length. Of each group, the
/// node that comes first stays, with its number and its place. Returns how many nodes were joined to others.
std::size_t merge_nodes(HighOrderMesh& mesh, double tolerance);

}  // namespace varimesh
