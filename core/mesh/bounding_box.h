// The bounding box of the nodes of a mesh.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/team.h"

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

/// The box of all points. Call it inside team.run().
/// @param coordinates x y z of each point, interleaved
BoundingBox bounding_box(const std::vector<double>& coordinates, const Team& team);

/// The box of the points with these indices.
BoundingBox bounding_box(const std::vector<double>& coordinates, const std::vector<std::int32_t>& points,
                         const Team& team);

}  // namespace varimesh
