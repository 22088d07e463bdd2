// Swaps and collapses of a cell's edges and faces. Internal to the library.
#pragma once

#include <cstdint>
#include <vector>

#include "core/repair/swaps/cell_patch.h"

namespace varimesh {

/// All changes of one edge or face of a cell of the patch that keep what must stay:
/// - 2-D: an edge between two triangles gets the other diagonal of their quadrilateral;
/// - 3-D: a face between two tetrahedra becomes an edge between three; an edge with 3 to 7 tetrahedra around it goes,
/// and
///   its two ends see each triangle of a triangulation of the ring around it;
/// - an interior vertex of the cell goes to the other end of one of its edges.
/// (L. A. Freitag, C. Ollivier-Gooch, Tetrahedral mesh improvement using swapping and smoothing, Int. J. Numer. Meth.
/// Engng 40, 1997.) The cells around are all of one block. A change is left out if the new cells would not fill the
/// room of the old ones as a mesh does: if an edge or face inside them exists elsewhere, or if more than two cells
/// would share a face. The best come first: the smallest straight-sided mean ratio of the new cells is the highest.
std::vector<CellChange> changes_around(const CellPatch& patch, std::int32_t cell);

}  // namespace varimesh
