// Reads the ISM meshes of HOHQMesh: quadrilaterals and hexahedra with curved sides. Internal to core/formats.
//
// Sources: HOHQMesh's documentation, "The ISM-v2 Mesh File Format" and "Appendix"; HORSES3D's user manual, "Mesh
// files"; Trixi.jl's documentation of UnstructuredMesh2D. Versions: the plain format of three numbers in the first
// line, ISM, ISM-V2 with a list of edges, and ISM-MM with a material per element.
#pragma once

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the bytes begin like an ISM mesh.
bool begins_like_ism(std::string_view bytes);

/// Reads a mesh. Curved sides have the file's points, at Chebyshev–Lobatto positions, and all else follows from them by
/// transfinite interpolation, as the format has it. Names of sides and materials become physical groups. Throws
/// ReadFailure, also if two elements disagree on a side that they share.
Expected<MeshFile> read_ism(std::string_view bytes, const Team& team);

}  // namespace varimesh::formats
