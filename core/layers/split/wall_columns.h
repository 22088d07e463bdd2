// The edges that rise from the vertices of a wall through the rows of cells above it. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh::detail {

/// The edges that rise one above the other from a vertex of the wall. At a corner several columns may rise from one
/// vertex.
struct WallColumn {
  std::vector<std::int32_t> vertices;  ///< One more than there are rows, from the wall.
  /// The unit normal of the wall at its vertex, into the mesh; zero if the wall has a sharp edge there.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> normals;  ///< Of the elements of the wall around the vertex.
  double size = 0;                       ///< The length of the shortest edge of the wall there.

  /// The normal of the wall; at a sharp edge, the normal of the wall element that makes the largest angle with
  /// `direction`.
  Eigen::Vector3d normal_seen_least(const Eigen::Vector3d& direction) const;
};

struct WallColumns {
  std::vector<WallColumn> columns;
  std::int64_t elements = 0;          ///< Elements of the wall.
  std::vector<std::int32_t> in_rows;  ///< The cells of the rows above the wall, sorted.
};

/// Errors: BadOption if a wall does not exist or has no elements on the boundary; BadInput if the cells above the wall
/// have no opposite side: triangles, tetrahedra, pyramids, and prisms that stand on one of their quadrilaterals.
/// @param walls  groups of elements of one dimension less than the mesh: names or tags of physical groups, or tags of
///               entities
Expected<WallColumns> find_wall_columns(const CheckedMesh& mesh, std::span<const std::string> walls, int rows);

}  // namespace varimesh::detail
