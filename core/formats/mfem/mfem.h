// Reads and writes MFEM's meshes. Internal to core/formats.
//
// Format: mfem.org, "Mesh formats": versions 1.0 to 1.3. A mesh may have straight sides, or its nodes may be a
// GridFunction in one of the spaces of mfem_space(). Periodic meshes are cut open, and periodic links keep what belongs
// together. Not read: meshes with hanging nodes, NURBS.
#pragma once

#include <string>
#include <string_view>

#include "core/base/team.h"
#include "core/formats/common/format.h"
#include "core/formats/mfem/space.h"

namespace varimesh::formats {

/// Whether the bytes begin like a mesh of MFEM.
bool begins_like_mfem(std::string_view bytes);

/// Reads a mesh. Attributes become entities and physical groups with the same tag, attribute sets the names of groups.
/// The nodes are converted to equispaced ones, which rounds them if the space has other points. Throws ReadFailure.
Expected<MeshFile> read_mfem(std::string_view bytes, const Team& team);

/// Writes a mesh: in the space from which it was read, otherwise in H1 on Gauss–Lobatto points; with straight sides if
/// it has order 1. Names of groups become attribute sets, for which it takes version 1.3, otherwise 1.0. Errors:
/// BadOption if the mesh is 1-D, or if elements with a common edge or face have different nodes there and the space is
/// continuous.
Expected<void> write_mfem(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// The part of write_mfem() that looks at shared sides (check_sides() in formats.h).
Expected<void> check_mfem_sides(const HighOrderMesh& mesh, const Team& team);

/// What a file of MFEM does not have of this mesh: one sentence, or nothing.
std::string not_in_mfem(const HighOrderMesh& mesh);

/// How the nodes of a file are stored, besides their space. HighOrderMesh::foreign keeps it from reading to writing.
struct MfemNodes {
  MfemSpace space;
  int components = 3;     ///< Numbers per node: 2 or 3.
  bool by_nodes = false;  ///< All first components come first; otherwise the components of each node together.
};
/// Notes them in the mesh.
void remember_mfem_nodes(HighOrderMesh& mesh, const MfemNodes& nodes);
/// What was noted, if the mesh still has the order and only shapes of the space; otherwise the nodes of
/// default_mfem_space(), with as many components as the mesh needs.
MfemNodes mfem_nodes_of(const HighOrderMesh& mesh);

/// MFEM's number of a shape, from 0 for points to 7 for pyramids.
int mfem_geometry(Shape shape);

}  // namespace varimesh::formats
