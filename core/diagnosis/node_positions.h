// Coordinates of some nodes as a matrix. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/index.h"

namespace varimesh::detail {

/// A row per node, in the order of `nodes`, and a column per component (x y z). `coordinates` as in
/// HighOrderMesh::coordinates.
inline Eigen::MatrixXd node_positions(const std::vector<double>& coordinates, std::span<const std::int32_t> nodes) {
  Eigen::MatrixXd x(static_cast<Eigen::Index>(nodes.size()), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    for (int c = 0; c < 3; ++c) x(static_cast<Eigen::Index>(n), c) = coordinates[3 * at(nodes[n]) + at(c)];
  return x;
}

}  // namespace varimesh::detail
