// Points at equal distances between two points of a curve or surface. Internal to core/curve.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/geometry/closest_point.h"
#include "core/geometry/geometry.h"

namespace varimesh::detail {

/// A point with its parameters on a curve (t, 0) or surface (u, v).
struct PlacedPoint {
  std::array<double, 2> at{};
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
};

/// The piece of a curve between two parameters.
class CurvePiece {
 public:
  CurvePiece(const geometry::CurveShape& curve, double from, double to);
  double length() const { return lengths_.back(); }
  /// The point at the arc length s, 0 ≤ s ≤ length().
  PlacedPoint at_length(double s) const;

 private:
  double length_between(double from, double to) const;

  const geometry::CurveShape* curve_;
  double from_, to_;
  std::vector<double> lengths_;  ///< From the start to each of the ends of equal intervals of the parameter.
};

/// count points between a and b on a surface, such that each point is the foot of the middle of its neighbours. So they
/// lie nearly on a geodesic, and the chords between them are nearly equal. Nothing if the feet are farther away than
/// half the distance between a and b.
std::optional<std::vector<PlacedPoint>> points_between(const geometry::SurfaceShape& surface,
                                                       const geometry::SurfaceSearch& search, const PlacedPoint& a,
                                                       const PlacedPoint& b, int count);

/// The foot of x from a guess. If it is farther than `limit`, or if Newton's method ended where it could not go on (at
/// a pole or the end of a range), the foot from samples of the whole surface, if that is nearer. Nothing if the foot is
/// farther than `limit`.
std::optional<PlacedPoint> foot_within(const geometry::SurfaceShape& surface, const geometry::SurfaceSearch& search,
                                       const Eigen::Vector3d& x, const std::array<double, 2>& guess, double limit);

}  // namespace varimesh::detail
