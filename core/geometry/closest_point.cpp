#include "core/geometry/closest_point.h"

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <optional>

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

namespace {

/// How often Newton's method goes on from a pole, a seam or a saddle.
constexpr int kMostPassages = 4;
/// A curvature of the squared distance that is more negative than this, over that of a plane, is no rounding.
constexpr double kSaddle = 1e-6;
/// A parameter along which the surface is shorter than this, over how long it is along the other, does not count: there
/// is a pole.
constexpr double kPole = 1e-9;
/// A step of Newton's method that is longer than this, over the length of the range, says only where downhill is.
constexpr double kLongStep = 0.25;
/// How many meridians of a pole are looked at.
constexpr int kMeridians = 16;
/// Ends of a range that are nearer than this, over the length of the surface along the other parameter, are one seam.
constexpr double kSeam = 1e-9;

/// Finds the foot of one point on a surface.
class SurfaceDescent {
 public:
  SurfaceDescent(const SurfaceShape& surface, const Eigen::Vector3d& point)
      : surface_(surface), point_(point), ranges_{surface.u_range(), surface.v_range()} {}

  /// Newton's method from a guess. Where it ends at a pole, at a seam or at a saddle, from which the distance falls
  /// elsewhere, it goes on there.
  SurfaceFoot foot(double u, double v) const {
    Standing now = place_at({u, v});
    descend(now);
    for (int k = 0; k < kMostPassages && now.distance < kInfinity; ++k) {
      auto beyond = past_pole(now);
      if (!beyond) beyond = past_seam(now);
      if (!beyond) beyond = past_saddle(now);
      if (!beyond) break;
      descend(*beyond);
      if (!(beyond->distance < now.distance)) break;
      now = *beyond;
    }
    return {now.t[0], now.t[1], now.at.x, now.distance};
  }

 private:
  using Standing = Place<Eigen::Vector2d, SurfacePoint>;

  Eigen::Vector2d clamp(const Eigen::Vector2d& wish) const {
    return {ranges_[0].clamp(wish[0]), ranges_[1].clamp(wish[1])};
  }
  Standing place_at(const Eigen::Vector2d& wish) const {
    const Eigen::Vector2d clamped = clamp(wish);
    const SurfacePoint at = surface_.at(clamped[0], clamped[1]);
    return {clamped, at, distance_to(at.x, point_)};
  }
  bool is_first(std::size_t k, double t) const {
    return ranges_[k].period <= 0 && t <= ranges_[k].first - ranges_[k].margin_before;
  }
  bool is_last(std::size_t k, double t) const {
    return ranges_[k].period <= 0 && t >= ranges_[k].last + ranges_[k].margin_after;
  }

  // E(u, v) = ½ |S(u, v) − x|² with the 2 × 2 Hessian H = SᵀS + second derivatives · (S − x). SᵀS replaces it if it is
  // not clearly positive definite: if H₁₁ ≤ (SᵀS)₁₁/10 or det H ≤ det(SᵀS)/100.
  // A parameter that stands at an end of its range and would leave it is held.
  void descend(Standing& now) const {
    const auto nearer = [&](const Eigen::Vector2d& step) {
      return step_nearer(now, step, point_, [&](const Eigen::Vector2d& wish) { return place_at(wish); });
    };
    for (int step = 0; step < kMostSteps && now.distance < kInfinity; ++step) {
      const SurfacePoint& at = now.at;
      const Eigen::Vector3d off = at.x - point_;
      Eigen::Vector2d slope(at.du.dot(off), at.dv.dot(off));
      Eigen::Matrix2d first, second;
      first << at.du.squaredNorm(), at.du.dot(at.dv), at.du.dot(at.dv), at.dv.squaredNorm();
      second << at.duu.dot(off), at.duv.dot(off), at.duv.dot(off), at.dvv.dot(off);
      Eigen::Matrix2d bend = first + second;
      if (bend(0, 0) <= 0.1 * first(0, 0) || bend.determinant() <= 0.01 * first.determinant()) bend = first;
      bend.diagonal() += 1e-14 * Eigen::Vector2d::Constant(first.trace());
      for (std::size_t k = 0; k < 2; ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        if (!((is_first(k, now.t[i]) && slope[i] > 0) || (is_last(k, now.t[i]) && slope[i] < 0))) continue;
        bend(0, 1) = bend(1, 0) = 0;
        bend(i, i) = 1;
        slope[i] = 0;
      }
      if (!(bend.determinant() > 0)) return;
      const Eigen::Vector2d length(-(bend(1, 1) * slope[0] - bend(0, 1) * slope[1]) / bend.determinant(),
                                   -(bend(0, 0) * slope[1] - bend(1, 0) * slope[0]) / bend.determinant());
      if ((at.du * length[0] + at.dv * length[1]).norm() <= negligible(at.x, point_)) return;
      const Eigen::Vector2d wish = now.t + length;
      const double before = now.distance;
      if (nearer(length)) continue;
      // A step that was clamped, or that was too long, as near a pole, need not go downhill. One along the slope does,
      // each parameter by itself.
      const Eigen::Vector2d most(kLongStep * ranges_[0].length(), kLongStep * ranges_[1].length());
      if (now.distance < before || (clamp(wish) == wish && (length.cwiseAbs().array() <= most.array()).all())) return;
      const Eigen::Vector2d downhill(first(0, 0) > 0 ? -slope[0] / first(0, 0) : 0,
                                     first(1, 1) > 0 ? -slope[1] / first(1, 1) : 0);
      if (!nearer(downhill.cwiseMin(most).cwiseMax(-most))) return;
    }
  }

  /// A place near a pole that is nearer to the point than the pole, where `now` is. At a pole one parameter does not
  /// move the point, so Newton's method sees only the meridian on which it came. Here the meridian is chosen that leads
  /// straight to the point.
  std::optional<Standing> past_pole(const Standing& now) const {
    for (std::size_t around = 0; around < 2; ++around) {
      const std::size_t along = 1 - around;
      const auto derivative = [&](const SurfacePoint& at) { return along == 0 ? at.du : at.dv; };
      const Eigen::Vector3d& turn = around == 0 ? now.at.du : now.at.dv;
      if (turn.norm() * ranges_[around].length() > kPole * derivative(now.at).norm() * ranges_[along].length())
        continue;
      double best = negligible(now.at.x, point_);
      Eigen::Vector2d from = now.t, step = Eigen::Vector2d::Zero();
      for (int i = 0; i < kMeridians; ++i) {
        Eigen::Vector2d t = now.t;
        t[Eigen::Index(around)] = ranges_[around].first + ranges_[around].length() * (i + 0.5) / kMeridians;
        const Eigen::Vector3d away = derivative(surface_.at(t[0], t[1]));
        const double downhill = away.dot(point_ - now.at.x) / away.norm();
        const bool is_barred =
            downhill > 0 ? is_last(along, t[Eigen::Index(along)]) : is_first(along, t[Eigen::Index(along)]);
        if (is_barred || !(std::abs(downhill) > best)) continue;
        best = std::abs(downhill);
        from = t;
        step[Eigen::Index(along)] = downhill / away.norm();
      }
      for (int half = 0; half < kMostHalvings && best > negligible(now.at.x, point_); ++half, step /= 2)
        if (Standing there = place_at(from + step); there.distance < now.distance) return there;
    }
    return std::nullopt;
  }

  /// The same place on the other side of a seam, if `now` is on the seam of a surface that closes although its
  /// parameter is not periodic, and the distance falls there.
  std::optional<Standing> past_seam(const Standing& now) const {
    for (std::size_t k = 0; k < 2; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const bool first = is_first(k, now.t[i]);
      if (!first && !is_last(k, now.t[i])) continue;
      Eigen::Vector2d t = now.t;
      t[i] = first ? ranges_[k].last + ranges_[k].margin_after : ranges_[k].first - ranges_[k].margin_before;
      const Standing there = place_at(t);
      const double length = (k == 0 ? there.at.du : there.at.dv).norm() * ranges_[k].length();
      const double slope = (k == 0 ? there.at.du : there.at.dv).dot(there.at.x - point_);
      if ((there.at.x - now.at.x).norm() <= kSeam * length && (first ? slope > 0 : slope < 0)) return there;
    }
    return std::nullopt;
  }

  /// A place that is nearer to the point than `now`, if that is no minimum: Newton's method stays where the slope
  /// vanishes, such as on the far side of a cone, exactly opposite the point.
  std::optional<Standing> past_saddle(const Standing& now) const {
    const SurfacePoint& at = now.at;
    const Eigen::Vector3d off = at.x - point_;
    for (std::size_t k = 0; k < 2; ++k) {
      const double flat = (k == 0 ? at.du : at.dv).squaredNorm();
      const double bend = flat + (k == 0 ? at.duu : at.dvv).dot(off);
      if (!(bend < -kSaddle * flat)) continue;
      Eigen::Vector2d step = Eigen::Vector2d::Zero();
      step[Eigen::Index(k)] = kLongStep * ranges_[k].length();
      for (int half = 0; half < kMostHalvings; ++half, step /= 2)
        for (const Eigen::Vector2d& way : {step, Eigen::Vector2d(-step)})
          if (Standing there = place_at(now.t + way); there.distance < now.distance) return there;
    }
    return std::nullopt;
  }

  const SurfaceShape& surface_;
  const Eigen::Vector3d& point_;
  std::array<Range, 2> ranges_;
};

}  // namespace

SurfaceFoot closest_from(const SurfaceShape& surface, const Eigen::Vector3d& point, double u, double v) {
  if (const PieceSearch* pieces = surface.pieces()) return pieces->closest_from(point, u, v);
  return SurfaceDescent(surface, point).foot(u, v);
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

Eigen::AlignedBox3d SurfaceSearch::box() const {
  if (x_.empty()) return {Eigen::Vector3d::Constant(-kInfinity), Eigen::Vector3d::Constant(kInfinity)};
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& x : x_)
    if (x.allFinite()) box.extend(x);
  if (box.isEmpty()) return box;
  const Eigen::Vector3d more = Eigen::Vector3d::Constant(0.1 * box.diagonal().norm());
  return {box.min() - more, box.max() + more};
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
