#include "core/geometry/joined.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/geometry/closest_point.h"

namespace varimesh::geometry {
namespace {

// ===== Surfaces =====

/// How far apart the values of u of two parts are.
constexpr double kStride = 4;
/// A foot on a neighbour may be farther than that on the guess's part by this, relative to the way from the guess.
constexpr double kDetour = 0.5;

/// The place of t in its range, from 0 to 1.
double relative(const Range& range, double t) {
  if (range.period > 0) t -= range.period * std::floor((t - range.first) / range.period);
  return (t - range.first) / range.length();
}

class JoinedSurface : public SurfaceShape, public PieceSearch {
 public:
  explicit JoinedSurface(std::vector<SurfacePart> parts) : parts_(std::move(parts)) {
    for (const SurfacePart& part : parts_) searches_.emplace_back(*part.shape);
  }

  SurfacePoint at(double u, double v) const override {
    const Place place = own(u, v);
    const SurfaceShape& shape = *parts_[place.part].shape;
    const double a = shape.u_range().length(), b = shape.v_range().length();
    const SurfacePoint p = shape.at(place.at[0], place.at[1]);
    return {p.x, a * p.du, b * p.dv, a * a * p.duu, a * b * p.duv, b * b * p.dvv};
  }
  Range u_range() const override { return {-0.5, kStride * static_cast<double>(parts_.size() - 1) + 0.5}; }
  Range v_range() const override { return {0, 1}; }
  Eigen::Vector3d normal(const SurfacePoint& at, double u, double v) const override {
    return parts_[own(u, v).part].sign * at.normal();
  }
  const PieceSearch* pieces() const override { return this; }
  bool contains(double u, double v) const override {
    const Place place = own(u, v);
    return parts_[place.part].shape->contains(place.at[0], place.at[1]);
  }

  bool may_fold() const override { return false; }

  SurfaceFoot closest_from(const Eigen::Vector3d& point, double u, double v) const override {
    const Place start = own(u, v);
    const SurfaceShape& shape = *parts_[start.part].shape;
    const SurfaceFoot here = geometry::closest_from(shape, point, start.at[0], start.at[1]);
    if (shape.contains(here.u, here.v)) return as_joined(start.part, here);
    const Eigen::Vector3d from = shape.at(start.at[0], start.at[1]).x;
    double least = here.distance + kDetour * (here.x - from).norm();
    SurfaceFoot best = as_joined(start.part, here);
    for (const std::size_t next : parts_[start.part].neighbours) {
      const SurfaceFoot there = searches_[next].closest(point);
      if (!(there.distance < least) || !parts_[next].shape->contains(there.u, there.v)) continue;
      least = there.distance;
      best = as_joined(next, there);
    }
    return best;
  }

  SurfaceFoot closest(const Eigen::Vector3d& point) const override {
    SurfaceFoot best, outside;
    best.distance = outside.distance = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const SurfaceFoot foot = searches_[k].closest(point);
      SurfaceFoot& of_kind = parts_[k].shape->contains(foot.u, foot.v) ? best : outside;
      if (foot.distance < of_kind.distance) of_kind = as_joined(k, foot);
    }
    return best.distance < std::numeric_limits<double>::infinity() ? best : outside;
  }

 private:
  /// Which part parameters belong to, and what they are there.
  struct Place {
    std::size_t part;
    std::array<double, 2> at;
  };
  Place own(double u, double v) const {
    const double most = static_cast<double>(parts_.size() - 1);
    const double k = std::clamp(std::floor(u / kStride + 0.5), 0.0, most);
    const auto part = static_cast<std::size_t>(k);
    const Range a = parts_[part].shape->u_range(), b = parts_[part].shape->v_range();
    return {part, {a.first + (u - kStride * k + 0.5) * a.length(), b.first + v * b.length()}};
  }
  SurfaceFoot as_joined(std::size_t k, SurfaceFoot foot) const {
    const auto at = parameters_on_joined(*parts_[k].shape, k, {foot.u, foot.v});
    foot.u = at[0];
    foot.v = at[1];
    return foot;
  }

  std::vector<SurfacePart> parts_;
  std::vector<SurfaceSearch> searches_;  ///< By part.
};

// ===== Curves =====

constexpr int kIntervals = 64;

double length_of(const CurveShape& curve) {
  const Range range = curve.range();
  double length = 0;
  Eigen::Vector3d last = curve.at(range.first).x;
  for (int i = 1; i <= kIntervals; ++i) {
    const Eigen::Vector3d next = curve.at(range.first + range.length() * i / kIntervals).x;
    length += (next - last).norm();
    last = next;
  }
  return length;
}

}  // namespace

std::shared_ptr<const SurfaceShape> join(std::vector<SurfacePart> parts) {
  assert(!parts.empty());
  return std::make_shared<JoinedSurface>(std::move(parts));
}

std::array<double, 2> parameters_on_joined(const SurfaceShape& part, std::size_t k, const std::array<double, 2>& at) {
  return {kStride * static_cast<double>(k) + relative(part.u_range(), at[0]) - 0.5, relative(part.v_range(), at[1])};
}

JoinedCurve::JoinedCurve(std::vector<CurvePart> parts, bool closed)
    : parts_(std::move(parts)), begins_{0}, closed_(closed) {
  for (const CurvePart& part : parts_) begins_.push_back(begins_.back() + length_of(*part.shape));
}

CurvePoint JoinedCurve::at(double t) const {
  if (closed_) t -= begins_.back() * std::floor(t / begins_.back());
  const auto after = std::upper_bound(begins_.begin() + 1, begins_.end() - 1, t);
  const auto k = static_cast<std::size_t>(after - begins_.begin()) - 1;
  const Range range = parts_[k].shape->range();
  double slope = range.length() / (begins_[k + 1] - begins_[k]);
  const double way = slope * (t - begins_[k]);
  if (parts_[k].backwards) slope = -slope;
  const CurvePoint p = parts_[k].shape->at(parts_[k].backwards ? range.last - way : range.first + way);
  return {p.x, slope * p.dt, slope * slope * p.dtt};
}

int JoinedCurve::intervals() const {
  constexpr int kMost = 3000;
  int sum = 0;
  for (const CurvePart& part : parts_) sum += part.shape->intervals();
  return std::min(sum, kMost);
}

double JoinedCurve::parameter(std::size_t k, double t) const {
  const Range range = parts_[k].shape->range();
  const double way = relative({range.first, range.last, 0, 0, 0}, t);
  return begins_[k] + (parts_[k].backwards ? 1 - way : way) * (begins_[k + 1] - begins_[k]);
}

}  // namespace varimesh::geometry
