// How far nodes of layers lie from their wall. Internal to core/layers.
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

  /// The distance of a point from the wall near a facet: to the nearest point of the facet, or of the facets that share
  /// a vertex with it if that lies on its border. In the mesh's unit of length, never negative. Threads may call it.
  double distance(const Eigen::Vector3d& point, std::int32_t facet) const;

 private:
  struct Foot {
    double distance;
    bool on_border;
  };
  Foot foot(const Eigen::Vector3d& point, std::int32_t facet) const;

  const Columns& columns_;
  std::vector<geometry::ElementMap> maps_;  ///< By facet of the walls.
};

}  // namespace varimesh::detail
