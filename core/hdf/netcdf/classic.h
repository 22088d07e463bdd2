// Reads netCDF files of the kinds before HDF5: classic, with 64-bit offsets, and CDF-5. Older Exodus files are such
// files. Source: "NetCDF Classic Format Specification", Unidata, and "CDF-5 Format Specification", Argonne National
// Laboratory.
#pragma once

#include <memory>
#include <string_view>

#include "core/hdf/content/source.h"

namespace varimesh::formats {

/// Opens the file that these bytes are; they must stay where they are. To readers it looks like an HDF5 file with one
/// group. Arrays that grow with the time steps are listed as of the kind Other. What the header describes is taken from
/// the allowance. Throws ReadFailure.
std::unique_ptr<Hdf5Source> open_netcdf(std::string_view bytes, FileAllowance& allowance);

}  // namespace varimesh::formats
