// The elements of the boundary in VTU files: which cell has each, and lines in plane meshes. VTK 9.1 crashes when it
// draws curved lines (types 21, 35 and 68) with subdivisions, and meshio does not read polylines. So curved lines are
// written as straight ones, with their ends. When they are read, they get the nodes between from the cell that has the
// edge, or, if no cell has it, from a list in the file. Internal to core/formats.
#pragma once

#include <cstdint>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// For each element of the boundary, block by block, the number of a cell with the same side; −1 if there is none.
std::vector<std::int64_t> cells_of_boundary(const HighOrderMesh& mesh);

/// Whether the lines of the block are written as straight ones.
bool is_written_straight(const HighOrderMesh& mesh, const ElementBlock& block);

/// The list of the curved lines, in a mesh of dimension 2, that lie on no edge of a cell. Each has its place among all
/// lines of the mesh, its order, and its nodes.
std::vector<std::int32_t> loose_lines(const HighOrderMesh& mesh);

/// Gives lines of order 1 in a mesh of dimension 2 the nodes that are listed for them, or those of the edge of a cell
/// of higher order with the same ends. A listed line with other ends, or with nodes that the mesh does not have, is
/// left out: another program has changed the file. Throws ReadFailure if the list is damaged, or if this takes more
/// memory than the file allows.
void curve_lines(HighOrderMesh& mesh, const std::vector<std::int32_t>& listed, FileAllowance& allowance);

}  // namespace varimesh::formats
