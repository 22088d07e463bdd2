// Reads the meshes that are HDF5 files. Internal to core/formats.
#pragma once

#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5/source.h"

namespace varimesh::formats {

/// Reads the file as the format that its content shows. Throws ReadFailure.
Expected<MeshFile> read_hdf5(std::string_view bytes, const Team& team);

/// The same for content from anywhere.
MeshFile read_hdf5_content(Hdf5Source& source, FileAllowance& allowance);

}  // namespace varimesh::formats
