// Groups of tetrahedra that fixed edges and faces leave little room or none, and where a split would give them some.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/split.h"

namespace varimesh {

/// What may be split, and which cells have it.
class SplitRules {
 public:
  /// `fixed` by node, as in diagnose(). References are kept.
  SplitRules(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed);

  /// Whether nothing fixed and no element of a lower dimension is on the edge or face, and all cells round it are
  /// tetrahedra whose straight-sided forms, and those of the parts, are not flat.
  bool may_split(const SplitPlace& place) const;

  /// The cells that have the edge or face, in order.
  std::vector<std::int32_t> cells_round(const SplitPlace& place) const;

  /// Whether the face with these vertices is on the boundary or has an element of its own.
  bool is_boundary(SplitPlace face) const;

 private:
  /// Nothing of the face or edge with these corners, in order round it, may be split.
  void hold(std::span<const std::int32_t> corners);
  bool may_cut(std::int32_t cell, const SplitPlace& place) const;
  Eigen::RowVectorXd basis_at_centre(std::size_t vertices) const;

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  const std::vector<bool>& fixed_;
  std::set<SplitPlace> faces_;                             // fixed ones, sorted
  std::set<std::pair<std::int32_t, std::int32_t>> edges_;  // theirs, and those of elements
  std::vector<std::uint32_t> first_;                       // by node
  std::vector<std::int32_t> cells_of_;
  double sign_;
  std::array<Eigen::RowVectorXd, 16> middle_;  // values of the basis at the centre of these vertices, by a bit each
};

/// Tetrahedra at a fixed vertex or along a fixed edge that have little room.
struct WeakGroup {
  std::int32_t vertex = -1;            ///< Index of the node; −1: along an edge.
  std::vector<std::int32_t> cells;     ///< In order.
  double margin = 0;                   ///< Dimensionless, of unit directions; not over the threshold, or else marked.
  std::vector<SplitPlace> candidates;  ///< Splits that bring a free direction in.
};

/// What makes a group weak.
struct WeakRule {
  double margin = 0;         ///< Groups with no more than this,
  std::vector<bool> wanted;  ///< and with such a cell: by cell.
  /// Corners (cell, index of a vertex node) whose groups are weak whatever their margin, in order.
  std::vector<std::pair<std::int32_t, std::int32_t>> marked;
};

/// Groups with a candidate, in the order of vertices and then of cells. Call it inside team.run().
///
/// At a fixed vertex v, cells are one group that are joined across faces at v with a free edge there (LinkPiece);
/// candidates are the edges opposite v of the faces between the group and others, or those faces where the edge is on
/// the boundary. Along the edge of two fixed faces of one cell, J depends on them alone: its margin is the smallest
/// determinant of unit derivatives along the edge and into both faces; candidates are the edge opposite, or the cell's
/// other faces.
std::vector<WeakGroup> weak_groups(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const SplitRules& rules,
                                   const WeakRule& rule, const Team& team);

/// Splits that give every group one of its candidates, as far as candidates do not share a cell: the one first that
/// gives most groups for the cells that it adds.
std::vector<SplitPlace> choose_splits(std::span<const WeakGroup> groups, const SplitRules& rules);

}  // namespace varimesh
