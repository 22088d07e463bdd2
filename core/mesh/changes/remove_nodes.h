// Removes nodes from a mesh.
#pragma once

#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Removes the nodes that are not to be kept. No element may have one. The others keep their numbers, their order and
/// their places; pairs of periodic links with a removed node go.
void remove_nodes(HighOrderMesh& mesh, const std::vector<bool>& keep);

}  // namespace varimesh
