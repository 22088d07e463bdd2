// How far points of layers lie from their wall, and in which direction. Internal to core/layers.
#pragma once

#include <vector>

#include "core/geometry/element_map.h"
#include "core/layers/columns.h"

namespace varimesh::detail {

/// The facets of the walls as maps, and who is whose neighbour.
class WallDistance {
 public:
  /// Both must outlive the object.
  WallDistance(const HighOrderMesh& mesh, const Columns& columns);

  /// A point's distance from the wall, in the mesh's unit of length and never negative, and the gradient of the
  /// distance there: a unit vector away from the wall, or 0 at a point of the wall.
  struct Distance {
    double value = 0;
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  };
  /// The distance from the wall near a facet: from the nearest point of the facet, or of the facets that share a vertex
  /// with it if the point lies beside the facet. Threads may call it.
  Distance distance(const Eigen::Vector3d& point, std::int32_t facet) const;

 private:
  struct Foot {
    Distance distance;
    bool leans = false;  ///< The point lies beside the facet, whose nearest point is on its border.
  };
  Foot foot(const Eigen::Vector3d& point, std::int32_t facet) const;

  const Columns& columns_;
  std::vector<geometry::ElementMap> maps_;  ///< By facet of the walls.
};

}  // namespace varimesh::detail
