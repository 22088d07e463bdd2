// Reads VTK unstructured grids. Internal to core/formats.
#pragma once

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the bytes begin like an XML file of VTK.
bool begins_like_vtk(std::string_view bytes);

/// Reads a mesh of linear, quadratic and Lagrange cells: arrays as text, base64 or raw, compressed with zlib or not.
/// Arrays of the cells become groups and entities: gmsh:physical, physical, material or attribute, and
/// gmsh:geometrical. Arrays of the file with the name of a group, its tag and its dimension name it. Other arrays are
/// left out. Throws ReadFailure.
Expected<MeshFile> read_vtu(std::string_view bytes, const Team& team);

}  // namespace varimesh::formats
