#include "core/geometry/foot_on_element.h"

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "core/reference/nodes.h"

namespace varimesh::geometry {
namespace {

constexpr int kMostSteps = 40;
constexpr int kMostHalvings = 14;
constexpr double kOnSide = 1e-12;
constexpr double kRounding = 1e-15;

/// A side of the reference element: out · (ξ, η) ≤ bound inside.
struct Side {
  Eigen::Vector2d out;
  double bound;
  double beyond(const Eigen::Vector2d& at) const { return out.dot(at) - bound; }
  Eigen::Vector2d along() const { return {-out[1], out[0]}; }
};

std::span<const Side> sides(Shape shape) {
  static const std::array<Side, 3> triangle{{{{-1, 0}, 1}, {{0, -1}, 1}, {{1, 1}, 0}}};
  static const std::array<Side, 4> square{{{{-1, 0}, 1}, {{0, -1}, 1}, {{1, 0}, 1}, {{0, 1}, 1}}};
  if (shape == Shape::Triangle) return triangle;
  return square;
}

Eigen::Vector2d into(Shape shape, Eigen::Vector2d at) {
  at = at.cwiseMax(-1).cwiseMin(1);
  if (shape == Shape::Triangle && at.sum() > 0) {
    const double half = at.sum() / 2;
    at = (at.array() - half).matrix().cwiseMax(-1);
    if (at.sum() > 0) (at[0] > at[1] ? at[0] : at[1]) -= at.sum();
  }
  return at;
}

/// Where the search stands.
struct Place {
  Eigen::Vector2d at;
  SurfacePoint p;
  double distance;
};

/// The step of Newton's method, or along a side if it would leave the element there. Zero at a minimum.
Eigen::Vector2d direction(Shape shape, const Place& now, const Eigen::Vector3d& point) {
  const Eigen::Vector3d off = now.p.x - point;
  const Eigen::Vector2d slope(now.p.du.dot(off), now.p.dv.dot(off));
  Eigen::Matrix2d first, second;
  first << now.p.du.squaredNorm(), now.p.du.dot(now.p.dv), now.p.du.dot(now.p.dv), now.p.dv.squaredNorm();
  second << now.p.duu.dot(off), now.p.duv.dot(off), now.p.duv.dot(off), now.p.dvv.dot(off);
  Eigen::Matrix2d bend = first + second;
  if (bend(0, 0) <= 0.1 * first(0, 0) || bend.determinant() <= 0.01 * first.determinant()) bend = first;
  bend.diagonal().array() += 1e-14 * first.trace();
  if (!(bend.determinant() > 0)) return Eigen::Vector2d::Zero();
  const auto leaves = [&](const Eigen::Vector2d& step) {
    return std::ranges::any_of(
        sides(shape), [&](const Side& side) { return side.beyond(now.at) > -kOnSide && side.out.dot(step) > 0; });
  };
  const Eigen::Vector2d newton = -bend.inverse() * slope;
  if (!leaves(newton)) return newton;
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  for (const Side& side : sides(shape)) {
    if (side.beyond(now.at) <= -kOnSide) continue;
    const Eigen::Vector2d along = side.along();
    const Eigen::Vector2d step = -slope.dot(along) / along.dot(bend * along) * along;
    if (!leaves(step) && slope.dot(step) < slope.dot(best)) best = step;
  }
  return best;
}

}  // namespace

bool is_in_element(Shape shape, const Eigen::Vector2d& at) {
  return std::ranges::all_of(sides(shape), [&](const Side& side) { return side.beyond(at) <= 1e-9; });
}

ElementFoot foot_on_element(const ElementMap& map, const Eigen::Vector3d& point, const Eigen::Vector2d& from,
                            double share) {
  const auto place = [&](const Eigen::Vector2d& at) {
    const SurfacePoint p = map.at(at[0], at[1]);
    return Place{at, p, (p.x - point).norm()};
  };
  Place now = place(into(map.shape(), from));
  for (int step = 0; step < kMostSteps; ++step) {
    Eigen::Vector2d by = direction(map.shape(), now, point);
    const double negligible = std::max(kRounding * (now.p.x.norm() + point.norm()), share * now.distance);
    if ((now.p.du * by[0] + now.p.dv * by[1]).norm() <= negligible) break;
    for (const Side& side : sides(map.shape()))
      if (const double out = side.out.dot(by); out > 0 && side.beyond(now.at) + out > 0)
        by *= std::max(-side.beyond(now.at), 0.0) / out;
    bool nearer = false;
    for (int half = 0; half < kMostHalvings && !nearer; ++half, by /= 2) {
      const Place there = place(now.at + by);
      if (!(there.distance < now.distance)) continue;
      nearer = (there.p.x - now.p.x).norm() > negligible;
      now = there;
      if (!nearer) break;
    }
    if (!nearer) break;
  }
  const bool border =
      std::ranges::any_of(sides(map.shape()), [&](const Side& side) { return side.beyond(now.at) > -1e-9; });
  return {now.at, now.p.x, now.distance, border};
}

namespace {

Eigen::Vector2d place_of_node(const ElementMap& map, std::size_t node) {
  const auto& place = reference::lattice(map.shape(), map.order())[node];
  return {-1 + 2.0 * place[0] / map.order(), -1 + 2.0 * place[1] / map.order()};
}

}  // namespace

Eigen::Vector2d nearest_node(const ElementMap& map, const Eigen::Vector3d& point) {
  Eigen::Index node = 0;
  (map.nodes().colwise() - point).colwise().squaredNorm().minCoeff(&node);
  return place_of_node(map, static_cast<std::size_t>(node));
}

ElementFoot nearest_foot(const ElementMap& map, const Eigen::Vector3d& point) {
  constexpr std::size_t kStarts = 3;
  constexpr double kOnIt = 1e-10;
  std::vector<std::pair<double, std::size_t>> nodes;
  for (Eigen::Index k = 0; k < map.nodes().cols(); ++k)
    nodes.emplace_back((map.nodes().col(k) - point).squaredNorm(), static_cast<std::size_t>(k));
  const std::size_t starts = std::min(kStarts, nodes.size());
  std::partial_sort(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(starts), nodes.end());
  ElementFoot best;
  for (std::size_t i = 0; i < starts; ++i) {
    const ElementFoot foot = foot_on_element(map, point, place_of_node(map, nodes[i].second));
    if (i == 0 || foot.distance < best.distance) best = foot;
    if (best.distance * best.distance <= kOnIt * kOnIt * nodes.back().first) break;
  }
  return best;
}

}  // namespace varimesh::geometry
