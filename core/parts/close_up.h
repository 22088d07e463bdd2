// The cells of a mesh in parts that need all their neighbours to be judged, read again by the first rank.
#pragma once

#include <cstdint>
#include <vector>

#include "core/parts/seams.h"

namespace varimesh {

/// Some cells of a mesh, in the order of the file, all elements of one dimension less, and the nodes of both.
struct CloseUp {
  HighOrderMesh mesh;
  /// Those of the mesh, except that a facet whose other cell was left out has its own cell for a neighbour. So only
  /// facets of the whole mesh's boundary are at the boundary.
  Facets facets;
  std::vector<std::int64_t> places;  ///< The place of each node among all nodes of the file.
};

/// Gathers the cells of all ranks that have a 1 in `shown` (by cell of the part), and reads them on the first rank;
/// nothing on the others. All ranks call it. Errors are the same on all ranks.
Expected<CloseUp> close_up(const formats::PartedFile& file, const Part& part, const std::vector<char>& shown,
                           const Seams& seams, const Ranks& ranks, const Team& team);

/// Sets a 1 for each cell with a facet about which the seams have something to say.
void show_notable(const Part& part, const Seams& seams, std::vector<char>& shown, const Team& team);

/// Sets a 1 for each cell that has one of these nodes, which are numbers of the file and ascend.
void show_cells_at(const Part& part, const std::vector<std::int64_t>& nodes, std::vector<char>& shown);

}  // namespace varimesh
