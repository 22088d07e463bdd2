// Writes PyFR's meshes (.pyfrm). Source: PyFR's developer guide and the layout that `pyfr
// import` gives its files since version 2.1.
#pragma once

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::hdf {
class Writer;
}  // namespace varimesh::hdf

namespace varimesh::formats {

/// Writes a mesh as `pyfr import` does: nodes, elements with the neighbours of their faces, periodic pairs, and the
/// partitioning into one part. Groups of sides are boundary conditions with their names. Errors: BadOption if more than
/// two cells share a side, if a 2-D mesh is not flat, or if the base of a pyramid is no parallelogram, which PyFR does
/// not take.
Expected<void> write_pyfr(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team);

}  // namespace varimesh::formats
