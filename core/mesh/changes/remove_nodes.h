// Removes nodes and fields from a mesh.
#pragma once

#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Removes the nodes that are not to be kept. No element may have one. The others keep their numbers, their order and
/// their places; pairs of periodic links with a removed node go.
void remove_nodes(HighOrderMesh& mesh, const std::vector<bool>& keep);

/// Removes the sections with fields on nodes and elements ($NodeData, $ElementData, $ElementNodeData), which have no
/// values for new ones.
void drop_fields(HighOrderMesh& mesh);

}  // namespace varimesh
