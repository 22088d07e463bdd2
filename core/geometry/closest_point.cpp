#include "core/geometry/closest_point.h"

#include <Eigen/LU>
#include <algorithm>
#include <limits>

namespace varimesh::geometry {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostSteps = 50;
constexpr int kMostSeeds = 6;
constexpr int kMostHalvings = 12;
/// A step that moves the foot by less than this, relative to the sizes of the coordinates, is the last.
constexpr double kRounding = 1e-15;

double distance_to(const Eigen::Vector3d& x, const Eigen::Vector3d& point) {
  return x.allFinite() ? (x - point).norm() : kInfinity;
}

double negligible(const Eigen::Vector3d& x, const Eigen::Vector3d& point) {
  return kRounding * (x.norm() + point.norm());
}

/// Where Newton's method stands.
template <class Parameters, class ShapePoint>
struct Place {
  Parameters t;     ///< t of a curve, (u, v) of a surface.
  ShapePoint at;    ///< The shape there.
  double distance;  ///< From the point whose foot is sought.
};

/// Halves the step until the distance falls, and goes there. Returns whether the foot has moved by more than rounding.
/// @param place_at  gives the Place for parameters, which it clamps to their ranges
template <class Parameters, class ShapePoint, class PlaceAt>
bool step_nearer(Place<Parameters, ShapePoint>& now, Parameters step, const Eigen::Vector3d& point,
                 const PlaceAt& place_at) {
  for (int half = 0; half < kMostHalvings; ++half, step /= 2) {
    const Place<Parameters, ShapePoint> there = place_at(Parameters(now.t + step));
    if (there.distance >= now.distance) continue;
    const bool moved = (there.at.x - now.at.x).norm() > negligible(now.at.x, point);
    now = there;
    return moved;
  }
  return false;
}

}  // namespace

// E(t) = ½ |C(t) − x|², E' = C'·(C − x), E'' = C'·C' + C''·(C − x). If E'' < C'·C'/10, C'·C' replaces it.
CurveFoot closest_from(const CurveShape& curve, const Eigen::Vector3d& point, double t) {
  const Range range = curve.range();
  const auto place_at = [&](double wish) {
    const double clamped = range.clamp(wish);
    const CurvePoint at = curve.at(clamped);
    return Place<double, CurvePoint>{clamped, at, distance_to(at.x, point)};
  };
  auto now = place_at(t);
  for (int step = 0; step < kMostSteps && now.distance < kInfinity; ++step) {
    const CurvePoint& at = now.at;
    const Eigen::Vector3d off = at.x - point;
    const double slope = at.dt.dot(off), speed = at.dt.squaredNorm();
    double bend = speed + at.dtt.dot(off);
    if (bend < 0.1 * speed) bend = speed;
    if (bend <= 0) break;
    const double length = -slope / bend;
    if (at.dt.norm() * std::abs(length) <= negligible(at.x, point)) break;
    if (!step_nearer(now, length, point, place_at)) break;
  }
  return {now.t, now.at.x, now.distance};
}

// The same with the 2 × 2 Hessian H = SᵀS + second derivatives · (S − x). SᵀS replaces it if it is not clearly positive
// definite: if H₁₁ ≤ (SᵀS)₁₁/10 or det H ≤ det(SᵀS)/100.
// A parameter that stands at an end of its range and would leave it is held.
SurfaceFoot closest_from(const SurfaceShape& surface, const Eigen::Vector3d& point, double u, double v) {
  if (const PieceSearch* pieces = surface.pieces()) return pieces->closest_from(point, u, v);
  const Range range_u = surface.u_range(), range_v = surface.v_range();
  const auto place_at = [&](const Eigen::Vector2d& wish) {
    const Eigen::Vector2d clamped(range_u.clamp(wish[0]), range_v.clamp(wish[1]));
    const SurfacePoint at = surface.at(clamped[0], clamped[1]);
    return Place<Eigen::Vector2d, SurfacePoint>{clamped, at, distance_to(at.x, point)};
  };
  auto now = place_at({u, v});
  for (int step = 0; step < kMostSteps && now.distance < kInfinity; ++step) {
    const SurfacePoint& at = now.at;
    const Eigen::Vector3d off = at.x - point;
    Eigen::Vector2d slope(at.du.dot(off), at.dv.dot(off));
    Eigen::Matrix2d first, second;
    first << at.du.squaredNorm(), at.du.dot(at.dv), at.du.dot(at.dv), at.dv.squaredNorm();
    second << at.duu.dot(off), at.duv.dot(off), at.duv.dot(off), at.dvv.dot(off);
    const auto held = [](const Range& range, double t, double downhill) {
      return range.period <= 0 && ((t <= range.first - range.margin_before && downhill < 0) ||
                                   (t >= range.last + range.margin_after && downhill > 0));
    };
    const std::array<bool, 2> hold = {held(range_u, now.t[0], -slope[0]), held(range_v, now.t[1], -slope[1])};
    Eigen::Matrix2d bend = first + second;
    if (bend(0, 0) <= 0.1 * first(0, 0) || bend.determinant() <= 0.01 * first.determinant()) bend = first;
    bend.diagonal() += 1e-14 * Eigen::Vector2d::Constant(first.trace());
    for (int k = 0; k < 2; ++k)
      if (hold[static_cast<std::size_t>(k)]) {
        bend(0, 1) = bend(1, 0) = 0;
        bend(k, k) = 1;
        slope[k] = 0;
      }
    if (!(bend.determinant() > 0)) break;
    const Eigen::Vector2d length(-(bend(1, 1) * slope[0] - bend(0, 1) * slope[1]) / bend.determinant(),
                                 -(bend(0, 0) * slope[1] - bend(1, 0) * slope[0]) / bend.determinant());
    if ((at.du * length[0] + at.dv * length[1]).norm() <= negligible(at.x, point)) break;
    if (!step_nearer(now, length, point, place_at)) break;
  }
  return {now.t[0], now.t[1], now.at.x, now.distance};
}

namespace {

/// The numbers of the kMostSeeds nearest samples, nearest first.
/// @param seeds  distance and number of each sample that is no farther than its neighbours
std::vector<int> nearest_first(std::vector<std::pair<double, int>> seeds) {
  const auto count = std::min<std::size_t>(seeds.size(), kMostSeeds);
  std::partial_sort(seeds.begin(), seeds.begin() + static_cast<std::ptrdiff_t>(count), seeds.end());
  std::vector<int> numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(seeds[i].second);
  return numbers;
}

std::vector<double> places(const Range& range, int intervals) {
  std::vector<double> t;
  for (int i = 0; i <= intervals; ++i) t.push_back(range.first + range.length() * i / intervals);
  return t;
}

}  // namespace

CurveSearch::CurveSearch(const CurveShape& curve) : curve_(&curve), t_(places(curve.range(), 2 * curve.intervals())) {
  for (const double t : t_) x_.push_back(curve.at(t).x);
}

CurveFoot CurveSearch::closest(const Eigen::Vector3d& point) const {
  std::vector<double> far;
  for (const Eigen::Vector3d& x : x_) far.push_back(distance_to(x, point));
  std::vector<std::pair<double, int>> seeds;
  const int last = static_cast<int>(far.size()) - 1;
  for (int i = 0; i <= last; ++i)
    if (far[std::size_t(i)] <= far[std::size_t(std::max(i - 1, 0))] &&
        far[std::size_t(i)] <= far[std::size_t(std::min(i + 1, last))])
      seeds.emplace_back(far[std::size_t(i)], i);
  CurveFoot best{0, Eigen::Vector3d::Zero(), kInfinity};
  for (const int seed : nearest_first(std::move(seeds))) {
    const CurveFoot foot = closest_from(*curve_, point, t_[std::size_t(seed)]);
    if (foot.distance < best.distance) best = foot;
  }
  return best;
}

SurfaceSearch::SurfaceSearch(const SurfaceShape& surface) : surface_(&surface) {
  if (surface.pieces() != nullptr) return;
  const std::array<int, 2> intervals = surface.intervals();
  u_ = places(surface.u_range(), intervals[0]);
  v_ = places(surface.v_range(), intervals[1]);
  rows_ = static_cast<int>(u_.size());
  columns_ = static_cast<int>(v_.size());
  for (const double u : u_)
    for (const double v : v_) x_.push_back(surface.at(u, v).x);
}

SurfaceFoot SurfaceSearch::closest(const Eigen::Vector3d& point) const {
  if (const PieceSearch* pieces = surface_->pieces()) return pieces->closest(point);
  std::vector<double> far(x_.size());
  for (std::size_t i = 0; i < x_.size(); ++i) far[i] = distance_to(x_[i], point);
  std::vector<std::pair<double, int>> seeds;
  for (int i = 0; i < rows_; ++i)
    for (int j = 0; j < columns_; ++j) {
      const double own = far[std::size_t(i * columns_ + j)];
      bool least = own < kInfinity;
      for (int a = std::max(i - 1, 0); a <= std::min(i + 1, rows_ - 1) && least; ++a)
        for (int b = std::max(j - 1, 0); b <= std::min(j + 1, columns_ - 1) && least; ++b)
          least = own <= far[std::size_t(a * columns_ + b)];
      if (least) seeds.emplace_back(own, i * columns_ + j);
    }
  SurfaceFoot best{0, 0, Eigen::Vector3d::Zero(), kInfinity};
  for (const int seed : nearest_first(std::move(seeds))) {
    const SurfaceFoot foot =
        closest_from(*surface_, point, u_[std::size_t(seed / columns_)], v_[std::size_t(seed % columns_)]);
    if (foot.distance < best.distance) best = foot;
  }
  return best;
}

}  // namespace varimesh::geometry
