// The polynomial map of one element of dimension 1 or 2 into space. Internal to the library.
#pragma once

#include "core/geometry/geometry.h"
#include "core/reference/shape.h"

namespace varimesh::geometry {

/// The map of an element from its reference coordinates, with second derivatives. Its basis functions are products of
/// the polynomials by P. Silvester, High-order polynomial triangular finite elements for potential problems,
/// Int. J. Engng Sci. 7, 1969.
class ElementMap {
 public:
  /// @param x positions of the equispaced nodes in Gmsh's order
  ElementMap(Shape shape, int order, Eigen::Matrix3Xd x);

  Shape shape() const { return shape_; }
  int order() const { return order_; }
  const Eigen::Matrix3Xd& nodes() const { return x_; }
  /// Of a line at ξ.
  CurvePoint at(double xi) const;
  /// Of a triangle or quadrilateral at (ξ, η).
  SurfacePoint at(double xi, double eta) const;

 private:
  Shape shape_;
  int order_;
  Eigen::Matrix3Xd x_;
};

/// The largest error of interpolation of degree P on an interval of length 1 over the error of the slope at its ends,
/// as the angle between two equal neighbours shows it: max |ω| over |ω'(0)| with ω(s) = ∏ (s − i/P) if P is odd. If P
/// is even, the neighbours' errors by ω have the same slope where they meet, and the angle shows those by ω(s) (s −
/// 1/2).
double error_over_slope(int order);

}  // namespace varimesh::geometry
