// Whether a mesh is numbered counter-clockwise or clockwise. Internal to the library.
#pragma once

#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// −1 if most straight-sided cells have a negative Jacobian at their centre, else 1. Call it inside team.run().
double orientation(const HighOrderMesh& mesh, const Team& team = Team(1));

/// By cell, in the mesh's order: 1 if it is numbered in the other sense than most cells. Neighbours across facets tell:
/// two cells of one sense see the vertices of their common facet in opposite order. So an inverted cell is not taken
/// for one that is numbered clockwise. In each group of cells that are joined across facets, the sign of most
/// straight-sided cells says which sense is which; a cell without neighbours is never reported. Empty if no cell is.
/// Call it inside team.run(). `facets`: those of the mesh.
std::vector<char> numbered_against_most(const HighOrderMesh& mesh, const Facets& facets, const Team& team = Team(1));

}  // namespace varimesh::detail
