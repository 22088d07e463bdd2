// Which edges and faces may be split or swapped, and which cells have them. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/problem/cells_at_vertices.h"
#include "core/repair/node_key.h"
#include "core/repair/split.h"

namespace varimesh {

/// Decides for each edge and face of a mesh whether it may be split, or swapped.
class SplitRules {
 public:
  /// `fixed`: by node, as in diagnose(). Keeps references to all three.
  SplitRules(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed);

  /// Whether the edge or face may be split: no fixed node and no element of a lower dimension lies on it, all cells
  /// around it are tetrahedra, and neither their straight-sided forms nor those of the parts are flat.
  bool may_split(const SplitPlace& place) const;

  /// Whether the edge or face lies inside the mesh, free of everything: it is not on the boundary, no element of a
  /// lower dimension and no fixed node lies on it, and all cells around it are triangles or tetrahedra.
  bool is_inside(const SplitPlace& place) const;

  /// The cells that have the edge or face, in ascending order.
  std::vector<std::int32_t> cells_around(const SplitPlace& place) const;

  const detail::CellsAtVertices& at_vertices() const { return at_vertices_; }

  /// Whether the face is on the boundary or has an element of its own.
  bool is_boundary(const SplitPlace& face) const;

 private:
  /// Forbids splitting the face or edge with these corners, given in order around it, and the edges of the face.
  void forbid(std::span<const std::int32_t> corners);
  bool is_forbidden(const SplitPlace& place) const;
  /// Whether a fixed node of the cell lies inside the edge or face, or between it and something else.
  bool holds_fixed_node(std::int32_t cell, const SplitPlace& place) const;
  bool may_cut(std::int32_t cell, const SplitPlace& place) const;
  Eigen::RowVectorXd basis_at_centre(std::size_t vertices) const;

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  const std::vector<bool>& fixed_;
  std::set<SplitPlace> faces_;                             // those on the boundary or with an element
  std::set<std::pair<std::int32_t, std::int32_t>> edges_;  // edges of these faces, and edges with an element
  detail::CellsAtVertices at_vertices_;
  double sign_;
  std::map<Shape, NodeWeights> weights_;
  // Values of the basis at the centre of some of a tetrahedron's vertices; bit v of the index stands for vertex v.
  std::array<Eigen::RowVectorXd, 16> centre_basis_;
};

}  // namespace varimesh
