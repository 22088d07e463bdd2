// Reads meshes from Abaqus' input files, which CalculiX, Gmsh and others write too. Internal to core/formats.
#pragma once

#include <string_view>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the first line that is no comment is a keyword, such as *HEADING or *NODE.
bool begins_like_abaqus(std::string_view bytes);

/// Reads *NODE, *ELEMENT, *ELSET and *SURFACE of elements: C3D4, C3D5, C3D6, C3D8, C3D10, C3D15, C3D20 and C3D27; CPS,
/// CPE, CAX, S and others of 3, 4, 6 and 8 nodes; trusses and beams. Sets of elements and surfaces become physical
/// groups. Other elements are left out, and a note counts them. Refuses several parts and instances that move their
/// part. Throws ReadFailure.
Expected<MeshFile> read_abaqus(std::string_view bytes, const Team& team);

}  // namespace varimesh::formats
