// Whether the cells of a mesh share the nodes of their common edges and faces. Internal to core/formats.
#pragma once

#include <optional>

#include "core/formats/mfem/topology.h"

namespace varimesh::formats {

/// Returns the first cell that has other nodes on an edge or face than the first cell with the same vertices; nothing
/// if there is none. Nodes at the same place count as the same. A continuous space cannot hold such a mesh: a file
/// would have another mesh. Call it inside team.run().
std::optional<std::size_t> find_unshared_side(const HighOrderMesh& mesh, const Cells& cells, const MfemCells& vertices,
                                              const MfemTopology& topology, const Team& team);

}  // namespace varimesh::formats
