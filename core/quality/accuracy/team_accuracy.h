// The loss of accuracy with the threads of a team, and the memory that it takes.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/team.h"
#include "core/mesh/mesh_counts.h"
#include "core/quality/accuracy/accuracy.h"

namespace varimesh {

/// cell_accuracy() and accuracy() with the team's threads. Do not call them inside team.run(). The team's token may
/// interrupt them.
CellAccuracy cell_accuracy(const HighOrderMesh& mesh, const Team& team);
Accuracy accuracy(const HighOrderMesh& mesh, const Team& team);
/// The same of the mesh with its nodes at other coordinates, as HighOrderMesh::coordinates.
Accuracy accuracy(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team);

/// The most bytes that accuracy() has in use, beside the tables.
std::int64_t bytes_of_accuracy(const MeshCounts& counts);

/// The bytes of the tables, which are kept until the program ends.
std::int64_t bytes_of_accuracy_tables(const MeshCounts& counts);

}  // namespace varimesh
