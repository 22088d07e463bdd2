// Reads and writes the HDF5 meshes of HOPR, which FLEXI, GALAEXI, PICLas, FLUXO and HORSES3D read. Source: HOPR's user
// guide, "HOPR HDF5 Curved Mesh Format".
#pragma once

#include "core/base/team.h"
#include "core/formats/common/format.h"
#include "core/hdf/content/source.h"

namespace varimesh::hdf {
class Writer;
}  // namespace varimesh::hdf

namespace varimesh::formats {

/// Reads a mesh. Zones become physical groups of cells, boundary conditions physical groups of sides with their names,
/// and periodic boundaries periodic links. Throws ReadFailure.
MeshFile read_hopr(Hdf5Source& source, FileAllowance& allowance);

/// Writes a mesh with all that HOPR writes: the sides' neighbours with their orientation, boundary conditions, and the
/// nodes of every element row by row. Errors: BadOption if the mesh is not 3-D, or if more than two cells share a side.
Expected<void> write_hopr(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team);

}  // namespace varimesh::formats
