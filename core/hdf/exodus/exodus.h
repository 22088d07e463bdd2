// Reads Exodus files, in HDF5 (netCDF-4) or an older kind of netCDF, which MOOSE, Cubit, Sierra and others write.
// Source: "Exodus: A Finite Element Data Model", SAND92-2137, revised.
#pragma once

#include "core/formats/common/format.h"
#include "core/hdf/content/source.h"

namespace varimesh::formats {

/// Reads a mesh of orders 1 and 2. Element blocks and side sets become physical groups, whose tags are their ids; a
/// side set gets a free tag where a block of the same dimension has its id. Fields and node sets are not read. Throws
/// ReadFailure.
MeshFile read_exodus(Hdf5Source& source, FileAllowance& allowance);

}  // namespace varimesh::formats
