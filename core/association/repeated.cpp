#include "core/association/repeated.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <memory>
#include <utility>

#include "core/geometry/closest_point.h"

namespace varimesh::detail {
namespace {

using geometry::Curve;
using geometry::Geometry;
using geometry::Surface;
using Points = std::vector<Eigen::Vector3d>;

constexpr int kOnCurve = 12;                        ///< Samples of a curve, less one.
constexpr int kOnSurface = 5, kMostOnSurface = 50;  ///< Samples of a surface in each direction.
/// Samples miss a little of the box of what is curved. This, over the diagonal of the box, is more.
constexpr double kMissed = 0.1;
/// A curve that is shorter than this, over the tolerance, lies on every curve nearby.
constexpr double kShort = 10;
/// Curves with a larger sine of the angle between them cross.
constexpr double kCrossing = 1e-3;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

double place(const geometry::Range& range, double s) { return range.first + s * range.length(); }

bool is_seam(const Curve& curve) { return curve.surfaces.size() == 2 && curve.surfaces[0] == curve.surfaces[1]; }

void add_new(std::vector<int>& to, const std::vector<int>& more) {
  const std::vector<int> old = to;
  for (const int one : more)
    if (std::ranges::find(old, one) == old.end()) to.push_back(one);
}

/// A curve or surface with samples.
template <class Search>
struct Sampled {
  Points samples;
  Points border;  ///< Of a surface: samples of the curves around it, without seams.
  Eigen::AlignedBox3d box, wide;
  std::unique_ptr<Search> search;  ///< Made when it is needed first.

  void measure_box(double tolerance) {
    for (const Eigen::Vector3d& x : samples) box.extend(x);
    for (const Eigen::Vector3d& x : border) box.extend(x);
    wide = box;
    if (box.isEmpty()) return;
    const Eigen::Vector3d more = Eigen::Vector3d::Constant(tolerance + kMissed * box.diagonal().norm());
    wide.extend(box.min() - more).extend(box.max() + more);
  }
  bool may_contain(const Sampled& other) const { return !other.box.isEmpty() && wide.contains(other.box); }
};

class Merging {
 public:
  Merging(Geometry& geometry, double tolerance, const Team& team)
      : geometry_(geometry), tolerance_(tolerance), team_(team) {
    for (const Curve& curve : geometry.curves) curves_.push_back(sampled(curve));
    for (const Surface& surface : geometry.surfaces) surfaces_.push_back(sampled(surface));
  }

  Repeated run() {
    find_parts(curves_, curves_on_, [&](std::size_t b, std::size_t a) { return is_part_of_curve(b, a); });
    find_parts(surfaces_, surfaces_on_, [&](std::size_t b, std::size_t a) { return is_part_of_surface(b, a); });
    const std::vector<int> curve = firsts(curves_on_), surface = firsts(surfaces_on_);
    share_borders(curve, surface);
    return compact(curve, surface);
  }

 private:
  using On = std::vector<std::vector<int>>;  ///< By curve or surface: those on which all its samples lie.

  Sampled<geometry::CurveSearch> sampled(const Curve& curve) const {
    Sampled<geometry::CurveSearch> result;
    for (int i = 0; i <= kOnCurve; ++i)
      result.samples.push_back(curve.shape->at(place(curve.shape->range(), double(i) / kOnCurve)).x);
    result.measure_box(tolerance_);
    if (result.box.isEmpty() || result.box.diagonal().norm() < kShort * tolerance_) result.box.setEmpty();
    return result;
  }

  Sampled<geometry::SurfaceSearch> sampled(const Surface& surface) const {
    Sampled<geometry::SurfaceSearch> result;
    const geometry::SurfaceShape& shape = *surface.shape;
    // A narrow face may lie between the samples.
    for (int n = kOnSurface; result.samples.empty() && n <= kMostOnSurface; n = 2 * n + 1)
      for (int i = 0; i < n * n; ++i) {
        const double u = place(shape.u_range(), (i / n + 0.5) / n), v = place(shape.v_range(), (i % n + 0.5) / n);
        if (shape.contains(u, v)) result.samples.push_back(shape.at(u, v).x);
      }
    for (const int c : surface.curves)
      if (!is_seam(geometry_.curves[index(c)]))
        result.border.insert(result.border.end(), curves_[index(c)].samples.begin(), curves_[index(c)].samples.end());
    result.measure_box(tolerance_);
    return result;
  }

  /// Asks is_part(b, a) for all pairs whose boxes allow it.
  template <class Search, class IsPart>
  void find_parts(std::vector<Sampled<Search>>& all, On& on, const IsPart& is_part) {
    On candidates(all.size());
    for (std::size_t b = 0; b < all.size(); ++b)
      for (std::size_t a = 0; a < all.size(); ++a)
        if (a != b && all[a].may_contain(all[b])) candidates[b].push_back(static_cast<int>(a));
    std::vector<char> is_needed(all.size(), 0);
    for (std::size_t b = 0; b < all.size(); ++b)
      for (const int a : candidates[b]) is_needed[index(a)] = is_needed[b] = 1;
    team_.for_each(static_cast<std::int32_t>(all.size()), 1, [&](std::int32_t i) {
      if (is_needed[index(i)] != 0) make_search(index(i), all[index(i)].search);
    });
    on.resize(all.size());
    team_.for_each(static_cast<std::int32_t>(all.size()), 1, [&](std::int32_t b) {
      for (const int a : candidates[index(b)])
        if (is_part(index(b), index(a))) on[index(b)].push_back(a);
    });
  }
  void make_search(std::size_t c, std::unique_ptr<geometry::CurveSearch>& search) const {
    search = std::make_unique<geometry::CurveSearch>(*geometry_.curves[c].shape);
  }
  void make_search(std::size_t s, std::unique_ptr<geometry::SurfaceSearch>& search) const {
    search = std::make_unique<geometry::SurfaceSearch>(*geometry_.surfaces[s].shape);
  }

  bool is_part_of_curve(std::size_t b, std::size_t a) const {
    return std::ranges::all_of(curves_[b].samples, [&](const Eigen::Vector3d& x) {
      return curves_[a].search->closest(x).distance <= tolerance_;
    });
  }

  bool lies_on(const Eigen::Vector3d& x, std::size_t surface) const {
    const geometry::SurfaceFoot foot = surfaces_[surface].search->closest(x);
    return foot.distance <= tolerance_ && geometry_.surfaces[surface].shape->contains(foot.u, foot.v);
  }
  bool lies_on_border(const Eigen::Vector3d& x, std::size_t surface) const {
    return std::ranges::any_of(geometry_.surfaces[surface].curves, [&](int c) {
      const Curve& curve = geometry_.curves[index(c)];
      return !is_seam(curve) && geometry::CurveSearch(*curve.shape).closest(x).distance <= tolerance_;
    });
  }

  /// All of b lies on a, and no border of a, of a hole for example, runs inside b.
  bool is_part_of_surface(std::size_t b, std::size_t a) const {
    const auto on_a = [&](const Eigen::Vector3d& x) { return lies_on(x, a); };
    return !surfaces_[b].samples.empty() && std::ranges::all_of(surfaces_[b].samples, on_a) &&
           std::ranges::all_of(surfaces_[b].border, on_a) &&
           std::ranges::none_of(surfaces_[a].border, [&](const Eigen::Vector3d& x) {
             return surfaces_[b].box.exteriorDistance(x) <= tolerance_ && lies_on(x, b) && !lies_on_border(x, b);
           });
  }

  static bool has(const On& on, std::size_t b, int a) { return std::ranges::binary_search(on[b], a); }

  /// By curve or surface: the first one that is the same.
  static std::vector<int> firsts(const On& on) {
    std::vector<int> first;
    for (std::size_t b = 0; b < on.size(); ++b) {
      first.push_back(static_cast<int>(b));
      for (const int a : on[b])
        if (index(a) < b && has(on, index(a), static_cast<int>(b))) {
          first[b] = first[index(a)];
          break;
        }
    }
    return first;
  }

  /// Curves bound what those that are the same or a part of them bound, and surfaces are bounded by the curves of
  /// their parts.
  void share_borders(const std::vector<int>& curve, const std::vector<int>& surface) {
    for (std::size_t s = 0; s < surface.size(); ++s) {
      std::vector<int> wholes;
      for (const int a : surfaces_on_[s])
        if (!has(surfaces_on_, index(a), static_cast<int>(s))) wholes.push_back(a);
      if (index(surface[s]) != s) wholes.push_back(surface[s]);
      for (const int a : wholes)
        for (const int c : geometry_.surfaces[s].curves) {
          if (is_seam(geometry_.curves[index(c)])) continue;
          add_new(geometry_.surfaces[index(a)].curves, {c});
          add_new(geometry_.curves[index(c)].surfaces, {a});
        }
    }
    for (std::size_t b = 0; b < curve.size(); ++b) {
      std::vector<int> wholes;
      for (const int a : curves_on_[b])
        if (!has(curves_on_, index(a), static_cast<int>(b))) wholes.push_back(a);
      if (index(curve[b]) != b) wholes.push_back(curve[b]);
      for (const int a : wholes) {
        add_new(geometry_.curves[index(a)].surfaces, geometry_.curves[b].surfaces);
        for (const int s : geometry_.curves[b].surfaces) add_new(geometry_.surfaces[index(s)].curves, {a});
      }
    }
  }

  /// The place of each first one among the first ones.
  static std::vector<int> places(const std::vector<int>& first) {
    std::vector<int> place;
    int next = 0;
    for (std::size_t i = 0; i < first.size(); ++i)
      place.push_back(index(first[i]) == i ? next++ : place[index(first[i])]);
    return place;
  }
  /// The new numbers, each once. A seam keeps its surface twice.
  static std::vector<int> renumbered(const std::vector<int>& old, const std::vector<int>& place) {
    std::vector<int> result;
    for (std::size_t i = 0; i < old.size(); ++i)
      if (const int now = place[index(old[i])]; std::ranges::find(result, now) == result.end() ||
                                                std::count(old.begin(), old.begin() + std::ptrdiff_t(i), old[i]) > 0)
        result.push_back(now);
    return result;
  }

  Repeated compact(const std::vector<int>& curve, const std::vector<int>& surface) {
    const std::vector<int> curve_place = places(curve), surface_place = places(surface);
    Repeated result;
    std::vector<Curve> curves;
    std::vector<Surface> surfaces;
    for (std::size_t c = 0; c < curve.size(); ++c) {
      if (index(curve[c]) != c) continue;
      curves.push_back(std::move(geometry_.curves[c]));
      curves.back().surfaces = renumbered(curves.back().surfaces, surface_place);
    }
    for (std::size_t s = 0; s < surface.size(); ++s) {
      if (index(surface[s]) != s) continue;
      surfaces.push_back(std::move(geometry_.surfaces[s]));
      surfaces.back().curves = renumbered(surfaces.back().curves, curve_place);
      std::vector<int>& wholes = result.part_of.emplace_back();
      for (const int a : surfaces_on_[s])
        if (surface[index(a)] != static_cast<int>(s)) add_new(wholes, {surface_place[index(a)]});
    }
    result.surfaces = static_cast<int>(surface.size() - surfaces.size());
    geometry_.curves = std::move(curves);
    geometry_.surfaces = std::move(surfaces);
    return result;
  }

  Geometry& geometry_;
  const double tolerance_;
  const Team& team_;
  std::vector<Sampled<geometry::CurveSearch>> curves_;
  std::vector<Sampled<geometry::SurfaceSearch>> surfaces_;
  On curves_on_, surfaces_on_;
};

/// Whether the curve lies in the surface and within its boundary on one side of the parameter t at least.
/// @param foot  parameters of the point at t on the surface
bool lies_in(const geometry::CurveShape& curve, double t, const geometry::SurfaceShape& surface,
             const std::array<double, 2>& foot, double tolerance) {
  constexpr std::array<double, 3> kSteps{0.005, 0.01, 0.02};  // of the curve's range
  const geometry::Range range = curve.range();
  return std::ranges::any_of(std::array{1.0, -1.0}, [&](double side) {
    double u = foot[0], v = foot[1];
    return std::ranges::all_of(kSteps, [&](double step) {
      const double at = t + side * step * range.length();
      if (range.period <= 0 && (at < range.first || at > range.last)) return false;
      const geometry::SurfaceFoot next = geometry::closest_from(surface, curve.at(at).x, u, v);
      u = next.u;
      v = next.v;
      return next.distance <= tolerance && surface.contains(u, v);
    });
  });
}

}  // namespace

int complete_at(Geometry& geometry, const std::vector<CommonPoint>& points, double tolerance) {
  std::vector<geometry::CurveSearch> searches;
  for (const Curve& curve : geometry.curves) searches.emplace_back(*curve.shape);
  int added = 0;
  for (const CommonPoint& point : points) {
    std::vector<int> curves;
    for (const int s : point.surfaces) add_new(curves, geometry.surfaces[index(s)].curves);
    Points directions;  // of the curves through the point
    for (const int c : curves) {
      Curve& curve = geometry.curves[index(c)];
      if (is_seam(curve)) continue;
      const geometry::CurveFoot foot = searches[index(c)].closest(point.x);
      if (!(foot.distance <= tolerance)) continue;
      directions.push_back(curve.shape->at(foot.t).dt.normalized());
      for (std::size_t k = 0; k < point.surfaces.size(); ++k) {
        const int s = point.surfaces[k];
        if (std::ranges::find(curve.surfaces, s) != curve.surfaces.end() ||
            !lies_in(*curve.shape, foot.t, *geometry.surfaces[index(s)].shape, point.feet[k], tolerance))
          continue;
        curve.surfaces.push_back(s);
        add_new(geometry.surfaces[index(s)].curves, {c});
        ++added;
      }
    }
    const bool is_corner = std::ranges::any_of(
        directions, [&](const Eigen::Vector3d& d) { return d.cross(directions.front()).norm() > kCrossing; });
    const auto is_there = [&](const geometry::Vertex& vertex) { return (vertex.x - point.x).norm() <= tolerance; };
    if (!is_corner || std::ranges::any_of(geometry.vertices, is_there)) continue;
    geometry.vertices.push_back({0, point.x});
    ++added;
  }
  return added;
}

Repeated merge_repeated(Geometry& geometry, double tolerance, const Team& team) {
  return Merging(geometry, tolerance, team).run();
}

}  // namespace varimesh::detail
