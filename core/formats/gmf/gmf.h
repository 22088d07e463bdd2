// Reads GMF's meshes, .mesh and .meshb, which libMeshb, Medit, Mmg, Vizir, Gmsh and others write. Internal to
// core/formats.
#pragma once

#include <string_view>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the bytes begin like a text or a binary file of GMF.
bool begins_like_gmf(std::string_view bytes);

/// Reads vertices and elements of orders 1 to 4, versions 1 to 4, text and binary of either byte order. References of
/// elements become physical groups with the same tag; those that are no tags (negative ones, and those above 10⁹) get
/// free tags and a name. Elements of order 2 and above have the order of nodes that the file's ...Ordering says;
/// without it, lines, triangles up to order 3, quadrilaterals and tetrahedra of order 2 have the usual one, those under
/// a keyword of order 1 have Gmsh's, and others are refused. Refuses sections with more numbers than they announce, and
/// files without End. Throws ReadFailure.
Expected<MeshFile> read_gmf(std::string_view bytes, const Team& team);

}  // namespace varimesh::formats
