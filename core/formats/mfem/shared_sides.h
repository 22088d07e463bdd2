// Whether the cells of a mesh share the nodes of their common edges and faces. Internal to core/formats.
#pragma once

#include <optional>
#include <string_view>

#include "core/base/error.h"
#include "core/formats/mfem/topology.h"

namespace varimesh::formats {

/// Returns the first cell that has other nodes on an edge or face than the first cell with the same vertices; nothing
/// if there is none. Nodes at the same place count as the same. A continuous space cannot hold such a mesh: a file
/// would have another mesh. Call it inside team.run().
std::optional<std::size_t> find_unshared_side(const HighOrderMesh& mesh, const Cells& cells, const MfemCells& vertices,
                                              const MfemTopology& topology, const Team& team);

/// The error about such a cell: BadOption. `format`: whose format it is, such as "MFEM's".
tl::unexpected<Error> unshared_side(const Cells& cells, std::size_t cell, std::string_view format);

/// Returns that error if a mesh has such a cell, and another BadOption if a cell has a node as two of its vertices.
/// Call it inside team.run().
Expected<void> check_shared_sides(const HighOrderMesh& mesh, std::string_view format, const Team& team);

}  // namespace varimesh::formats
