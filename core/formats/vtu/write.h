// Writes VTK unstructured grids. Internal to core/formats.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/team.h"
#include "core/formats/common/format.h"

namespace varimesh::formats {

/// Writes the cells of the mesh, with their fields, to a VTU file. The points of the file are the mesh's nodes in
/// order. Additional points of pyramids of order 2 and above follow.
Expected<void> write_vtu(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                         const Team& team);

/// What a VTU file does not have of this mesh: one sentence, or nothing.
std::string not_in_vtu(const HighOrderMesh& mesh);

/// The name of a list in the file that VTK passes on and does not use: all nodes of each pyramid of order 3 and above,
/// in Gmsh's order. VTK's cell has only some of them.
inline constexpr const char* kVtkPyramids = "varimesh:pyramids";

/// The additional points of a pyramid of order 2 and above, in the order of the −1 of VtkCell::nodes: a matrix for the
/// nodes of the pyramid, one row per point.
const Eigen::MatrixXd& vtk_added_points(int order);

}  // namespace varimesh::formats
