// Writes meshes for SU2, whose elements are straight. Internal to core/formats.
//
// Format: su2code.github.io, "Mesh file": VTK's cell types, points from 0, and a marker for each boundary.
#pragma once

#include <string>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Writes the vertices of the cells, the cells between them, and a marker for each physical group of the boundary.
/// Errors: BadOption if the mesh is 1-D, or lies in space without being a solid.
Expected<void> write_su2(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                         const Team& team);

/// What a file of SU2 does not have of this mesh: one sentence, or nothing.
std::string not_in_su2(const HighOrderMesh& mesh);

}  // namespace varimesh::formats
