// Reads and writes CGNS files in HDF5, up to order 4. Sources: CGNS SIDS, and the CGNS SIDS
// file mapping manual with its description of HDF5 files.
//
// The files are read as HDF5, not with libcgns: version 3.4 of it, which Debian has, refuses files of version 4, which
// programs have written since 2019. A test reads with libcgns what VariMesh writes.
#pragma once

#include "core/base/team.h"
#include "core/formats/common/format.h"
#include "core/hdf/content/source.h"

namespace varimesh::hdf {
class Writer;
}  // namespace varimesh::hdf

namespace varimesh::formats {

/// Reads the unstructured zones of a file and joins them to one mesh (zones.h). Boundary conditions become physical
/// groups of sides, subregions physical groups of cells. Throws ReadFailure.
MeshFile read_cgns(Hdf5Source& source, FileAllowance& allowance);

/// Writes one zone in CGNS version 3.4: a section for consecutive elements of one shape, a boundary condition for each
/// group of sides, a subregion for each group of cells. Errors: BadOption if the order is above 4.
Expected<void> write_cgns(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team);

/// The child of a boundary condition or a subregion that contains its tag (SIDS: an integer without a meaning of its
/// own).
inline constexpr const char* kCgnsOrdinal = "Ordinal";
/// The child that contains the whole name, if CGNS's names, of at most 32 characters without a slash, cannot.
inline constexpr const char* kCgnsWholeName = "GroupName";

}  // namespace varimesh::formats
