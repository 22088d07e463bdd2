#include "core/geometry/analytic.h"

#include <functional>
#include <numbers>

namespace varimesh::geometry {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Range kTurn{0, 2 * kPi, 2 * kPi};

class Line : public CurveShape {
 public:
  Line(const Eigen::Vector3d& a, const Eigen::Vector3d& b) : a_(a), b_(b) {}
  CurvePoint at(double t) const override { return {a_ + t * (b_ - a_), b_ - a_, Eigen::Vector3d::Zero()}; }
  Range range() const override { return {0, 1, 0}; }

 private:
  Eigen::Vector3d a_, b_;
};

class Circle : public CurveShape {
 public:
  Circle(const Frame& frame, double radius) : frame_(frame), radius_(radius) {}
  CurvePoint at(double t) const override {
    const Eigen::Vector3d out = radius_ * (std::cos(t) * frame_.axes.col(0) + std::sin(t) * frame_.axes.col(1));
    const Eigen::Vector3d along = radius_ * (std::cos(t) * frame_.axes.col(1) - std::sin(t) * frame_.axes.col(0));
    return {frame_.origin + out, along, -out};
  }
  Range range() const override { return kTurn; }

 private:
  Frame frame_;
  double radius_;
};

class Plane : public SurfaceShape {
 public:
  Plane(const Frame& frame, double width, double height) : frame_(frame), width_(width), height_(height) {}
  SurfacePoint at(double u, double v) const override {
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const auto& axes = frame_.axes;
    return {frame_.origin + u * axes.col(0) + v * axes.col(1), axes.col(0), axes.col(1), zero, zero, zero};
  }
  Range u_range() const override { return {0, width_, 0}; }
  Range v_range() const override { return {0, height_, 0}; }

 private:
  Frame frame_;
  double width_, height_;
};

/// ρ(v) and z(v), each with its first and second derivatives.
struct Profile {
  double rho, drho, ddrho, z, dz, ddz;
};

class Revolution : public SurfaceShape {
 public:
  Revolution(const Frame& frame, Range v, std::function<Profile(double)> profile)
      : frame_(frame), v_(v), profile_(std::move(profile)) {}
  SurfacePoint at(double u, double v) const override {
    const Profile p = profile_(v);
    const Eigen::Vector3d out = std::cos(u) * frame_.axes.col(0) + std::sin(u) * frame_.axes.col(1);
    const Eigen::Vector3d along = std::cos(u) * frame_.axes.col(1) - std::sin(u) * frame_.axes.col(0);
    const Eigen::Vector3d up = frame_.axes.col(2);
    return {frame_.origin + p.rho * out + p.z * up,
            p.rho * along,
            p.drho * out + p.dz * up,
            -p.rho * out,
            p.drho * along,
            p.ddrho * out + p.ddz * up};
  }
  Range u_range() const override { return kTurn; }
  Range v_range() const override { return v_; }

 private:
  Frame frame_;
  Range v_;
  std::function<Profile(double)> profile_;
};

std::shared_ptr<const SurfaceShape> revolution(const Frame& frame, Range v, std::function<Profile(double)> profile) {
  return std::make_shared<Revolution>(frame, v, std::move(profile));
}

}  // namespace

std::shared_ptr<const CurveShape> line(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::make_shared<Line>(a, b);
}

std::shared_ptr<const CurveShape> circle(const Frame& frame, double radius) {
  return std::make_shared<Circle>(frame, radius);
}

std::shared_ptr<const SurfaceShape> plane(const Frame& frame, double width, double height) {
  return std::make_shared<Plane>(frame, width, height);
}

std::shared_ptr<const SurfaceShape> cylinder(const Frame& frame, double radius, double height) {
  return revolution(frame, {0, height, 0}, [=](double v) { return Profile{radius, 0, 0, v, 1, 0}; });
}

std::shared_ptr<const SurfaceShape> cone(const Frame& frame, double radius, double half_angle, double length) {
  const double s = std::sin(half_angle), c = std::cos(half_angle);
  return revolution(frame, {0, length, 0}, [=](double v) { return Profile{radius + v * s, s, 0, v * c, c, 0}; });
}

std::shared_ptr<const SurfaceShape> sphere(const Frame& frame, double radius) {
  return revolution(frame, {-kPi / 2, kPi / 2, 0}, [=](double v) {
    const double c = radius * std::cos(v), s = radius * std::sin(v);
    return Profile{c, -s, -c, s, c, -s};
  });
}

std::shared_ptr<const SurfaceShape> torus(const Frame& frame, double major_radius, double minor_radius) {
  return revolution(frame, kTurn, [=](double v) {
    const double c = minor_radius * std::cos(v), s = minor_radius * std::sin(v);
    return Profile{major_radius + c, -s, -c, s, c, -s};
  });
}

}  // namespace varimesh::geometry
