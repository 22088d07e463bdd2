// Reads and writes CGNS files in HDF5, up to order 4. Internal to core/formats. Sources: CGNS SIDS, and the CGNS SIDS
// file mapping manual with its description of HDF5 files.
//
// The files are read as HDF5, not with libcgns: version 3.4 of it, which Debian has, refuses files of version 4, which
// programs have written since 2019. A test reads with libcgns what VariMesh writes.
#pragma once

#include <map>
#include <string>

#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5/source.h"

namespace varimesh::formats {

/// Whether a file with this root group is a CGNS file.
bool is_cgns(const Hdf5Group& root);

/// Reads the unstructured zones of a file and joins them to one mesh (zones.h). Boundary conditions become physical
/// groups of sides, subregions physical groups of cells. Throws ReadFailure.
MeshFile read_cgns(Hdf5Source& source, FileAllowance& allowance);

/// Writes one zone in CGNS version 3.4: a section for consecutive elements of one shape, a boundary condition for each
/// group of sides, a subregion for each group of cells. Errors: BadOption if the order is above 4.
Expected<void> write_cgns(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// What a CGNS file does not have of this mesh: one sentence, or nothing.
std::string not_in_cgns(const HighOrderMesh& mesh);

/// The types of boundary conditions, such as BCWall, by the tags of their groups, which HighOrderMesh::foreign keeps
/// from reading to writing.
void remember_cgns_types(HighOrderMesh& mesh, const std::map<int, std::string>& types);
std::map<int, std::string> cgns_types_of(const HighOrderMesh& mesh);

/// The child of a boundary condition or a subregion that contains its tag (SIDS: an integer without a meaning of its
/// own).
inline constexpr const char* kCgnsOrdinal = "Ordinal";
/// The child that contains the whole name, if CGNS's names, of at most 32 characters without a slash, cannot.
inline constexpr const char* kCgnsWholeName = "GroupName";

}  // namespace varimesh::formats
