// The elements of the boundary in VTU files: which cell has each, and lines in plane meshes. VTK 9.1 crashes when it
// draws curved lines (types 21, 35 and 68) with subdivisions, and meshio does not read polylines. So a line of order P
// is written as P straight pieces from node to node. The first has the number of the line, and the others kNextPiece.
// Internal to core/formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/formats/vtu/cells.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// For each cell of the file that is an element of the boundary or a piece of one, block by block, the number of a cell
/// with the same side; −1 if there is none.
std::vector<std::int64_t> cells_of_boundary(const HighOrderMesh& mesh);

/// How many cells the file has for an element of the block.
std::size_t pieces_of(const HighOrderMesh& mesh, const ElementBlock& block);
/// The number of a piece that goes on where the one before it ends.
inline constexpr std::int64_t kNextPiece = 0;
/// The cells that the file has for a line of this order: the nodes of all pieces.
VtkCell vtk_pieces(int order);

/// Joins the pieces of lines. Other lines of order 1 in a mesh of dimension 2 get the nodes of the edge of a cell of
/// higher order with the same ends: programs write them so. Throws ReadFailure if this takes more memory than the file
/// allows.
void curve_lines(HighOrderMesh& mesh, FileAllowance& allowance);

}  // namespace varimesh::formats
