// The formats that are HDF5 files: HOPR, CGNS, PyFR and Exodus. A program of its own reads and writes them (core/hdf),
// so that a damaged or hostile file harms only this program. Internal to core/formats.
#pragma once

#include <string>
#include <string_view>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the bytes begin like an HDF5 file, or like a netCDF file of an older kind, which the program reads as well.
bool begins_like_hdf5(std::string_view bytes);

/// Reads a file of HOPR, CGNS or Exodus. What the program answers is checked (mesh_bytes.h). Throws ReadFailure and
/// Interrupted.
Expected<MeshFile> read_hdf5(std::string_view bytes, const Team& team);

/// Writes a file of this format. Errors: BadOption if the format cannot contain the mesh or the program is not
/// installed, Output if the sink stopped or the program failed.
Expected<void> write_hdf5(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// What a file of each format does not have of this mesh: one sentence, or nothing.
std::string not_in_hopr(const HighOrderMesh& mesh);
std::string not_in_cgns(const HighOrderMesh& mesh);
std::string not_in_pyfr(const HighOrderMesh& mesh);

/// What the writers of HOPR's and PyFR's files say of shared sides (check_sides() in formats.h).
Expected<void> check_hopr_sides(const HighOrderMesh& mesh, const Team& team);
Expected<void> check_pyfr_sides(const HighOrderMesh& mesh, const Team& team);

/// The names of the formats in sentences.
inline constexpr const char* kHoprName = "HOPR's";
inline constexpr const char* kPyfrName = "PyFR's";

}  // namespace varimesh::formats
