// Reads and writes Nektar++'s XML files. Internal to core/formats.
//
// Format: see file.h. Only edges and faces are curved there, and in 2-D elements. The interior of a 3-D cell is the one
// that Nektar++ makes of its boundary (blending.h), so it is that interior that a reader certifies.
#pragma once

#include <string>
#include <string_view>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Whether the bytes begin like a file of Nektar++.
bool begins_like_nektar(std::string_view bytes);

/// Reads a mesh. Composites become entities and physical groups with the same tags, and their names those of groups.
/// Composite 0 gets the first tag that is free after the others. Everything outside the geometry, such as expansions
/// and conditions, is kept and written again. Throws ReadFailure.
Expected<MeshFile> read_nektar(std::string_view bytes, const Team& team);

/// Writes a mesh, as text if it was read so, otherwise compressed, with evenly spaced points on all edges and faces
/// from order 2 on. The order of the vertices of cells is the one that Nektar++ needs: a triangle collapses towards the
/// same vertex in both its cells. Errors: BadOption if the mesh is 1-D, if no such order exists,
/// or if elements with a common edge or face have different nodes there.
Expected<void> write_nektar(const HighOrderMesh& mesh, Format format, const Sink& sink,
                            std::span<const CellField> fields, const Team& team);

/// The part of write_nektar() that looks at shared sides (check_sides() in formats.h).
Expected<void> check_nektar_sides(const HighOrderMesh& mesh, const Team& team);

/// What a file of Nektar++ does not have of this mesh: one sentence, or nothing.
std::string not_in_nektar(const HighOrderMesh& mesh);

/// Nektar++'s order of a prism's vertices, as Gmsh's local numbers: its triangles 0, 1, 4 and 3, 2, 5 collapse towards
/// its edge from 4 to 5, which is Gmsh's from 1 to 4.
inline constexpr std::array<std::int8_t, 6> kNektarPrism = {0, 2, 5, 3, 1, 4};

}  // namespace varimesh::formats
