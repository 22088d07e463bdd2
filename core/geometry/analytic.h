// Curves and surfaces with formulas: line, circle, plane, cylinder, cone, sphere, torus. Internal to the library.
#pragma once

#include <memory>

#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// A right-handed frame: the axes are orthonormal columns X, Y, Z.
struct Frame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
};

/// a + t (b − a), 0 ≤ t ≤ 1.
std::shared_ptr<const CurveShape> line(const Eigen::Vector3d& a, const Eigen::Vector3d& b);
/// origin + r (X cos t + Y sin t), with period 2π.
std::shared_ptr<const CurveShape> circle(const Frame& frame, double radius);

/// origin + u X + v Y, 0 ≤ u ≤ width, 0 ≤ v ≤ height.
std::shared_ptr<const SurfaceShape> plane(const Frame& frame, double width, double height);

// Surfaces of revolution: origin + ρ(v) (X cos u + Y sin u) + z(v) Z, with period 2π in u.

/// ρ = r, z = v, 0 ≤ v ≤ height.
std::shared_ptr<const SurfaceShape> cylinder(const Frame& frame, double radius, double height);
/// ρ = r + v sin α, z = v cos α, 0 ≤ v ≤ length. α is half the opening angle in radians. There is a pole at ρ = 0.
std::shared_ptr<const SurfaceShape> cone(const Frame& frame, double radius, double half_angle, double length);
/// ρ = r cos v, z = r sin v, −π/2 ≤ v ≤ π/2. The poles are at the ends.
std::shared_ptr<const SurfaceShape> sphere(const Frame& frame, double radius);
/// ρ = R + r cos v, z = r sin v, with period 2π in v too.
std::shared_ptr<const SurfaceShape> torus(const Frame& frame, double major_radius, double minor_radius);

}  // namespace varimesh::geometry
