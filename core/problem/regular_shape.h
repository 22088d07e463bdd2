// The regular shapes. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/reference/shape.h"

namespace varimesh {

/// W: the gradient of the affine map from the reference cell to the regular shape with edges of length 1. The edges of
/// a reference cell along the axes have length 2.
inline Eigen::Matrix3d regular_shape(Shape shape) {
  const double root3 = std::sqrt(3.0), root2 = std::sqrt(2.0);
  Eigen::Matrix3d twice = Eigen::Matrix3d::Identity();
  const bool on_triangle = shape == Shape::Triangle || shape == Shape::Tetrahedron || shape == Shape::Prism;
  if (on_triangle) twice.col(1) << 0.5, root3 / 2, 0;
  if (shape == Shape::Tetrahedron) twice.col(2) << 0.5, root3 / 6, root2 / root3;
  if (shape == Shape::Pyramid) twice(2, 2) = 1 / root2;  // its height
  return 0.5 * twice;
}

}  // namespace varimesh
