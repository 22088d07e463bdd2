// Groups of tetrahedra that fixed edges and faces leave little or no room, and the edges and faces that are candidates
// for a split because it would make room. Internal to the library.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/split.h"
#include "core/repair/split_rules.h"

namespace varimesh {

/// A cell and the index of the node at one of its vertices.
using CellCorner = std::pair<std::int32_t, std::int32_t>;

/// Tetrahedra at a fixed vertex or along a fixed edge that have little room.
struct WeakGroup {
  std::int32_t vertex = -1;            ///< Index of the node; −1 for a group along an edge.
  std::vector<std::int32_t> cells;     ///< In ascending order.
  double margin = 0;                   ///< Dimensionless, of unit directions. At most the rule's, unless marked.
  std::vector<SplitPlace> candidates;  ///< Splits that add a free direction between the fixed ones.
};

/// What makes a group weak: a margin of at most this, and at least one wanted cell.
struct WeakRule {
  double margin = 0;
  std::vector<bool> wanted;        ///< By cell.
  std::vector<CellCorner> marked;  ///< Corners whose groups are weak whatever their margin, in ascending order.
};

/// The weak groups that have a candidate, in the order of vertices and then of cells. Call it inside team.run().
///
/// At a fixed vertex v, cells belong to one group if they are joined across faces at v with a free edge there
/// (LinkPiece). The candidates are the edges opposite v of the faces between the group and others; if such an edge is
/// on the boundary, the face.
///
/// Along the edge between two fixed faces of one cell, J depends on these faces only. The margin is the smallest
/// determinant of unit derivatives along the edge and into both faces. The candidate is the opposite edge, or else one
/// of the cell's other faces.
std::vector<WeakGroup> weak_groups(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const SplitRules& rules,
                                   const WeakRule& rule, const Team& team);

}  // namespace varimesh
