// The elements of the boundary in VTU files: which cell has each, and lines at the edge of plane meshes. VTK 9.1
// crashes when it draws curved lines (types 21, 35 and 68) with subdivisions, and meshio does not read polylines. So
// these lines are written as straight ones, with their ends, and get the nodes between from the cell that has the edge
// when they are read. Internal to core/formats.
#pragma once

#include <cstdint>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// For each element of the boundary, block by block, the number of a cell with the same side; −1 if there is none.
std::vector<std::int64_t> cells_of_boundary(const HighOrderMesh& mesh);

/// The blocks of curved lines, in a mesh of dimension 2, whose nodes are all nodes of edges of cells.
std::vector<const ElementBlock*> lines_on_edges(const HighOrderMesh& mesh);

/// Gives lines of order 1 in a mesh of dimension 2 the nodes of the edge of a cell of higher order with the same ends.
/// Throws ReadFailure if this takes more memory than the file allows.
void curve_lines(HighOrderMesh& mesh, FileAllowance& allowance);

}  // namespace varimesh::formats
