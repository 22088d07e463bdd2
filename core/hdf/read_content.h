// Reads the content of HDF5 files as the format that it shows.
#pragma once

#include "core/formats/common/format.h"
#include "core/hdf/content/source.h"

namespace varimesh::formats {

/// Reads a mesh of HOPR or a CGNS file. Throws ReadFailure.
MeshFile read_hdf5_content(Hdf5Source& source, FileAllowance& allowance);

}  // namespace varimesh::formats
