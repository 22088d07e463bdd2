// The bounding box of the cells of a mesh.
#pragma once

#include <array>
#include <limits>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Empty at first: low is +∞ and high is −∞.
struct BoundingBox {
  std::array<double, 3> low = all(std::numeric_limits<double>::infinity());
  std::array<double, 3> high = all(-std::numeric_limits<double>::infinity());

  void extend(const BoundingBox& other);
  void extend(const double* point);  ///< Three coordinates.

 private:
  static constexpr std::array<double, 3> all(double value) { return {value, value, value}; }
};

/// The box of the nodes that cells of the highest dimension use. Other nodes, such as the centres of arcs, count for
/// nothing. Call it inside team.run().
BoundingBox bounding_box(const HighOrderMesh& mesh, const Team& team);

}  // namespace varimesh
