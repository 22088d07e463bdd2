// In which directions a layer grows from the vertices of a wall, and how far. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "core/association/association.h"
#include "core/base/error.h"
#include "core/layers/grow/freedom.h"
#include "core/layers/walls.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh::detail {

/// What grows from a vertex of the wall.
struct GrowthColumn {
  std::int32_t vertex = -1;
  Eigen::Vector3d direction;  ///< Of unit length.
  double seen = 1;            ///< The smallest dot product of the direction and a normal of an element around.
  double asked = 0;           ///< The length that gives the layer its thickness, or is the most that it may have.
  double length = 0;
};

class GrowthColumns {
 public:
  /// A direction has the largest angle that it can have to all elements of the wall around its vertex, if the wall is
  /// not smooth there, and keeps to planes and lines in which the wall ends.
  /// Errors: BadInput if there is no such direction.
  /// @param model  what the mesh was made from, whose normals count; null: the elements' own normals do
  static Expected<GrowthColumns> find(const CheckedMesh& mesh, std::span<const WallElement> walls,
                                      const Freedoms& freedoms, double thickness, const Association* model);

  std::span<const GrowthColumn> columns() const { return columns_; }
  /// The column of a node; null if it is no vertex of the wall.
  const GrowthColumn* at_node(std::int32_t node) const;

  /// Shortens columns to a length by vertex and, less, those around them.
  void cap(const std::function<double(std::int32_t vertex)>& longest);
  /// Shortens columns at these vertices and, less, those around them.
  void shorten(std::span<const std::int32_t> vertices);
  /// The smallest length over what is asked for.
  const GrowthColumn& shortest() const;

 private:
  /// Shortens columns until they do not cross and no column is much longer than its neighbours.
  void limit();

  std::vector<GrowthColumn> columns_;
  std::vector<std::int32_t> column_of_;  ///< By node: −1 if there is none.
  /// The edges of the wall, by columns, with the vector from the first to the second vertex.
  struct Edge {
    std::int32_t from, to;
    Eigen::Vector3d along;
  };
  std::vector<Edge> edges_;
  std::vector<std::pair<std::int32_t, std::int32_t>> images_;  ///< Columns that are as long as each other.
};

}  // namespace varimesh::detail
