// Whether a mesh is numbered counter-clockwise or clockwise. Internal to the library.
#pragma once

#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// −1 if most straight-sided cells have a negative Jacobian at their centre, else 1.
double orientation(const HighOrderMesh& mesh);

/// By cell, in the mesh's order: 1 if it is numbered in the other sense than most cells. Neighbours across facets tell:
/// two cells of one sense see the vertices of their common facet in opposite order. So an inverted cell is not taken
/// for one that is numbered clockwise. In each group of cells that are joined across facets, the sign of most
/// straight-sided cells says which sense is which; a cell without neighbours is never reported. Empty if no cell is.
std::vector<char> numbered_against_most(const HighOrderMesh& mesh);

}  // namespace varimesh::detail
