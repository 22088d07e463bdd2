// The closest point of a curve or surface, by Newton's method from a guess or from samples. Internal to the library.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// The foot to which Newton's method comes from a guess: a local minimum of the distance. The foot is never farther
/// from `point` than the guess is. Parameters stay in their ranges; a periodic parameter may leave its range and stays
/// near the guess. A surface in pieces finds the foot itself.
CurveFoot closest_from(const CurveShape& curve, const Eigen::Vector3d& point, double t);
SurfaceFoot closest_from(const SurfaceShape& surface, const Eigen::Vector3d& point, double u, double v);

/// Finds closest points without a guess. It samples the curve once, and starts Newton's method at the samples that are
/// locally nearest. The least of the feet is the answer, which may lie outside the boundary of a trimmed surface.
class CurveSearch {
 public:
  explicit CurveSearch(const CurveShape& curve);
  CurveFoot closest(const Eigen::Vector3d& point) const;

 private:
  const CurveShape* curve_;
  std::vector<double> t_;
  std::vector<Eigen::Vector3d> x_;
};

class SurfaceSearch {
 public:
  explicit SurfaceSearch(const SurfaceShape& surface);
  SurfaceFoot closest(const Eigen::Vector3d& point) const;
  /// A box around the samples, a tenth of its diagonal larger on all sides, because samples miss a little of what is
  /// curved. It is unbounded for a surface in pieces.
  Eigen::AlignedBox3d box() const;

 private:
  const SurfaceShape* surface_;
  int rows_ = 0, columns_ = 0;
  std::vector<double> u_, v_;       ///< rows_ and columns_ values.
  std::vector<Eigen::Vector3d> x_;  ///< rows_ × columns_, row by row.
};

}  // namespace varimesh::geometry
