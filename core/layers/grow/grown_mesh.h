// A mesh with one more row of cells on its walls. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/layers/grow/curved_sides.h"
#include "core/layers/walls.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh::detail {

/// Puts a row of quadrilaterals, prisms or hexahedra on the elements of the walls. The nodes of the walls stay. The
/// cells of the mesh get copies of these nodes, which lie on top of the row, and other nodes move with the vertices
/// around them. Where elements of another boundary, of an interface or of a curve end at a wall, elements of the same
/// entity are added on the sides of the row. Nodes on curved sides stay on them. Periodic pairs get pairs.
///
/// The cells of the mesh must be numbered counter-clockwise; the cells of the row are so, too. The new cells come after
/// all other elements, and new nodes after all other nodes. Errors: BadInput if there would be too many.
/// @param displacements  by node, for vertices of cells; at vertices of walls, up to the top of the row
Expected<HighOrderMesh> grown_mesh(const CheckedMesh& mesh, std::span<const WallElement> walls,
                                   const CurvedSides& sides, std::span<const Eigen::Vector3d> displacements);

}  // namespace varimesh::detail
