// Writes PyFR's meshes (.pyfrm). Internal to core/formats. Source: PyFR's developer guide and the layout that `pyfr
// import` gives its files since version 2.1.
#pragma once

#include "core/base/team.h"
#include "core/formats/formats.h"

namespace varimesh::formats {

/// Writes a mesh as `pyfr import` does: nodes, elements with the neighbours of their faces, periodic pairs, and the
/// partitioning into one part. Groups of sides are boundary conditions with their names. Errors: BadOption if more than
/// two cells share a side, if a 2-D mesh is not flat, or if the base of a pyramid is no parallelogram, which PyFR does
/// not take.
Expected<void> write_pyfr(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// The part of write_pyfr() that looks at shared sides (check_sides() in formats.h).
Expected<void> check_pyfr_sides(const HighOrderMesh& mesh, const Team& team);

/// What a file of PyFR does not have of this mesh: one sentence, or nothing.
std::string not_in_pyfr(const HighOrderMesh& mesh);

}  // namespace varimesh::formats
