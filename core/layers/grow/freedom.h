// Which ways the vertices of a mesh may move so that its boundary keeps its shape. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/layers/grow/curved_sides.h"
#include "core/layers/grow/outer_facets.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// The directions in which a vertex may move.
struct Freedom {
  int count = 0;
  std::array<Eigen::Vector3d, 3> along{};  ///< The first `count` are orthonormal.

  /// @param directions  orthonormal, at most three
  static Freedom in(std::span<const Eigen::Vector3d> directions);

  /// The part of a displacement that is allowed.
  Eigen::Vector3d project(const Eigen::Vector3d& displacement) const;
};

/// By node, for vertices of cells. A vertex inside the mesh may move in all directions of the mesh. A vertex on the
/// boundary, besides the walls, or on an interface may move in the planes in which the elements around it lie, and
/// along the border between two entities of one plane, if it is straight; on curved sides at which a wall ends, it may
/// move in directions that touch them. It stays where other elements are curved, at corners, and where a periodic link
/// that is no translation has it. So do points and lines inside the mesh or inside a
/// plane, and the ends of interfaces, unless they are on a wall.
class Freedoms {
 public:
  /// @param outer  all outer facets of the mesh
  Freedoms(const HighOrderMesh& mesh, std::span<const OuterFacet> outer, const CurvedSides& sides);

  const Freedom& of(std::int32_t vertex) const { return freedoms_[std::size_t(vertex)]; }
  /// The first of the vertices that are images of each other under periodic links, and so move alike.
  std::int32_t master(std::int32_t vertex) const { return master_[std::size_t(vertex)]; }

 private:
  struct Around;

  void find_masters(const HighOrderMesh& mesh);
  void note_points_and_lines(const HighOrderMesh& mesh, std::map<std::int32_t, Around>& around,
                             const CurvedSides& sides);

  std::vector<Freedom> freedoms_;
  std::vector<std::int32_t> master_;
  std::vector<char> stays_;
};

}  // namespace varimesh::detail
