// How far a straight-sided simplex is from a regular one. Internal to the library.
#pragma once

#include <Eigen/Core>

namespace varimesh {

/// The mean ratio of a triangle (3 rows, in the plane z = constant) or tetrahedron (4 rows) with these vertices: 1 for
/// a regular one, 0 for a flat one, dimensionless, with the sign of the area or volume.
///   triangle     4 √3 A / Σ l²
///   tetrahedron  12 (3 V)^(2/3) / Σ l²
double mean_ratio(const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, 3>>& vertices);

}  // namespace varimesh
