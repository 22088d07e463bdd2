#include "core/curve/between.h"

#include <algorithm>
#include <cmath>

namespace varimesh::detail {
namespace {

constexpr int kIntervals = 32;
constexpr int kMostSweeps = 50;
/// Points that move by less than this, relative to the distance of the ends, are placed.
constexpr double kPlaced = 1e-5;

/// The cosine between normals a third of a turn apart.
constexpr double kThirdOfATurn = -0.5;
/// Points between the ends of an edge that goes round are at least so far from both, relative to the distance of the
/// ends. Halfway around a circle, it is 0.7.
constexpr double kInTheMiddle = 0.25;

/// A foot is stationary if the vector to it has a smaller part along the surface than this, relative to the limit.
constexpr double kStationary = 1e-6;

/// Gauss's rule with three points on [0, 1].
constexpr std::array<double, 3> kAt{0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> kWeight{5.0 / 18, 8.0 / 18, 5.0 / 18};

}  // namespace

CurvePiece::CurvePiece(const geometry::CurveShape& curve, double from, double to)
    : curve_(&curve), from_(from), to_(to), lengths_{0} {
  for (int i = 0; i < kIntervals; ++i)
    lengths_.push_back(lengths_.back() +
                       length_between(from + (to - from) * i / kIntervals, from + (to - from) * (i + 1) / kIntervals));
}

double CurvePiece::length_between(double from, double to) const {
  double length = 0;
  for (std::size_t k = 0; k < kAt.size(); ++k)
    length += kWeight[k] * curve_->at(from + kAt[k] * (to - from)).dt.norm() * std::abs(to - from);
  return length;
}

PlacedPoint CurvePiece::at_length(double s) const {
  const auto above = std::ranges::upper_bound(lengths_, s) - lengths_.begin();
  const auto i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 1, kIntervals) - 1);
  const double step = (to_ - from_) / kIntervals, start = from_ + step * static_cast<double>(i);
  const double whole = lengths_[i + 1] - lengths_[i];
  double part = whole > 0 ? std::clamp((s - lengths_[i]) / whole, 0.0, 1.0) : 0;
  for (int newton = 0; newton < 3 && whole > 0; ++newton) {
    const double speed = curve_->at(start + part * step).dt.norm() * std::abs(step);
    if (!(speed > 0)) break;
    part = std::clamp(part - (lengths_[i] + length_between(start, start + part * step) - s) / speed, 0.0, 1.0);
  }
  const double t = start + part * step;
  return {{t, 0}, curve_->at(t).x};
}

namespace {

/// Whether the vector from the foot to the point has no part along the surface. Newton's method may end elsewhere: at a
/// pole a step in one of the parameters leads nowhere, and at the end of a range it must stop.
bool is_stationary(const geometry::SurfaceShape& surface, const Eigen::Vector3d& x, const geometry::SurfaceFoot& foot,
                   double limit) {
  const geometry::SurfacePoint at = surface.at(foot.u, foot.v);
  const Eigen::Vector3d off = x - foot.x;
  return at.normal() != Eigen::Vector3d::Zero() && std::abs(off.dot(at.du.normalized())) <= kStationary * limit &&
         std::abs(off.dot(at.dv.normalized())) <= kStationary * limit;
}

}  // namespace

std::optional<PlacedPoint> foot_within(const geometry::SurfaceShape& surface, const geometry::SurfaceSearch& search,
                                       const Eigen::Vector3d& x, const std::array<double, 2>& guess, double limit) {
  geometry::SurfaceFoot foot = geometry::closest_from(surface, x, guess[0], guess[1]);
  if (!(foot.distance <= limit) || !is_stationary(surface, x, foot, limit)) {
    const geometry::SurfaceFoot other = search.closest(x);
    if (other.distance < foot.distance) foot = other;
  }
  if (!(foot.distance <= limit)) return std::nullopt;
  return PlacedPoint{{foot.u, foot.v}, foot.x};
}

namespace {

/// Moves each point but the first and the last to the foot of the middle of its neighbours, until they hardly move.
void relax(const geometry::SurfaceShape& surface, const geometry::SurfaceSearch& search,
           std::vector<PlacedPoint>& points) {
  const double chord = (points.back().x - points.front().x).norm();
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double moved = 0;
    for (std::size_t i = 1; i + 1 < points.size(); ++i) {
      const Eigen::Vector3d middle = 0.5 * (points[i - 1].x + points[i + 1].x);
      const auto foot = foot_within(surface, search, middle, points[i].at, 0.5 * chord);
      if (!foot) continue;
      moved = std::max(moved, (foot->x - points[i].x).norm());
      points[i] = *foot;
    }
    if (moved <= kPlaced * chord) break;
  }
}

/// Puts the points between the first and the last one to the feet of points on the chord. False if one is too far.
bool start_at_feet(const geometry::SurfaceShape& surface, const geometry::SurfaceSearch& search,
                   std::vector<PlacedPoint>& points) {
  const Eigen::Vector3d from = points.front().x, chord = points.back().x - from;
  // From both ends to the middle, so that a guess is never farther than a chord away.
  for (std::size_t low = 1, high = points.size() - 2; low <= high; ++low, --high)
    for (const std::size_t i : {low, high}) {
      const double part = static_cast<double>(i) / static_cast<double>(points.size() - 1);
      const PlacedPoint& neighbour = i == low ? points[i - 1] : points[i + 1];
      const auto foot = foot_within(surface, search, from + part * chord, neighbour.at, 0.5 * chord.norm());
      if (!foot) return false;
      points[i] = *foot;
    }
  return true;
}

/// Whether the edge goes round more than a third of a turn.
bool goes_round(const geometry::SurfaceShape& surface, const std::vector<PlacedPoint>& points) {
  const auto normal = [&](const PlacedPoint& point) {
    return surface.normal(surface.at(point.at[0], point.at[1]), point.at[0], point.at[1]);
  };
  return normal(points.front()).dot(normal(points.back())) < kThirdOfATurn;
}

/// Whether such an edge leaves the face in its middle, and so goes round the wrong side; or does not go round at all,
/// since the middle of its chord is equally far from all points.
bool leaves(const geometry::SurfaceShape& surface, const std::vector<PlacedPoint>& points) {
  const PlacedPoint& middle = points[points.size() / 2];
  const Eigen::Vector3d &first = points.front().x, &last = points.back().x;
  const double nearer = std::min((middle.x - first).norm(), (middle.x - last).norm());
  return goes_round(surface, points) &&
         (nearer < kInTheMiddle * (last - first).norm() || !surface.contains(middle.at[0], middle.at[1]));
}

}  // namespace

std::optional<std::vector<PlacedPoint>> points_between(const geometry::SurfaceShape& surface,
                                                       const geometry::SurfaceSearch& search, const PlacedPoint& a,
                                                       const PlacedPoint& b, int count) {
  std::vector<PlacedPoint> points(static_cast<std::size_t>(count) + 2);
  points.front() = a;
  points.back() = b;
  const bool is_found = start_at_feet(surface, search, points);
  if (is_found) relax(surface, search, points);
  if (is_found && !leaves(surface, points)) return std::vector<PlacedPoint>(points.begin() + 1, points.end() - 1);
  std::vector<PlacedPoint> others = points;  // along the parameters, it may stay in the face
  for (std::size_t i = 1; i + 1 < others.size(); ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(count + 1);
    for (const std::size_t k : {0u, 1u}) others[i].at[k] = a.at[k] + part * (b.at[k] - a.at[k]);
    others[i].x = surface.at(others[i].at[0], others[i].at[1]).x;
  }
  relax(surface, search, others);
  if (goes_round(surface, others) && !leaves(surface, others))
    points = std::move(others);
  else if (!is_found)
    return std::nullopt;
  return std::vector<PlacedPoint>(points.begin() + 1, points.end() - 1);
}

}  // namespace varimesh::detail
