#include "core/layers/error/wall_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/index.h"
#include "core/geometry/foot_on_element.h"
#include "core/layers/facet_table.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

constexpr int kMostSteps = 40;
constexpr double kSettled = 1e-12;  ///< A step that is this small in reference coordinates is the last.
/// On a facet of a solid, a step that is shorter than this share of the distance is not taken any more.
constexpr double kShortStep = 1e-6;
/// A point whose foot is on the border of a facet lies beside the facet if the sine of the angle between the way to it
/// and the normal is above this.
constexpr double kLeans = 1e-6;

/// The tangents of the wall at a foot, which are orthogonal.
struct Tangents {
  std::array<Vector, 2> of{Vector::Zero(), Vector::Zero()};
  std::size_t count = 0;

  std::span<const Vector> all() const { return std::span(of).first(count); }
};

/// The unit vector from a foot on the wall towards a point above it; `off` is the point minus the foot. Rounding of
/// coordinates, which is not small beside the height of thin layers, must not tilt it. So what is tangential in `off`
/// goes.
Vector away_from_wall(const Vector& off, const Tangents& tangents) {
  Vector normal = off;
  for (const Vector& tangent : tangents.all()) normal -= tangent * (tangent.dot(normal) / tangent.squaredNorm());
  return normal.stableNormalized();
}

/// The point of a line that is nearest to `point`, as far as Newton's method finds it from the nearest node, and
/// whether it is an end of the line.
std::pair<geometry::CurvePoint, bool> foot_on_line(const geometry::ElementMap& map, const Vector& point) {
  double xi = geometry::nearest_node(map, point)[0];
  geometry::CurvePoint now = map.at(xi);
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector off = now.x - point;
    const double first = now.dt.squaredNorm(), second = first + now.dtt.dot(off);
    double to = std::clamp(xi - now.dt.dot(off) / (second > 0.1 * first ? second : first), -1.0, 1.0);
    geometry::CurvePoint there = map.at(to);
    for (int half = 0; half < 20 && (there.x - point).norm() > off.norm(); ++half) {
      to = (to + xi) / 2;
      there = map.at(to);
    }
    if ((there.x - point).norm() > off.norm()) break;
    const bool settled = std::abs(to - xi) < kSettled;
    xi = to;
    now = there;
    if (settled) break;
  }
  return {now, std::abs(xi) > 1 - 1e-9};
}

}  // namespace

WallDistance::WallDistance(const HighOrderMesh& mesh, const Columns& columns) : columns_(columns) {
  maps_.reserve(columns.facets.size());
  for (const WallFacet& facet : columns.facets) {
    Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(facet.nodes.size()));
    for (std::size_t k = 0; k < facet.nodes.size(); ++k)
      x.col(static_cast<Eigen::Index>(k)) = point(mesh, facet.nodes[k]);
    maps_.emplace_back(facet.shape, mesh.order, std::move(x));
  }
}

WallDistance::Foot WallDistance::foot(const Vector& point, std::int32_t facet) const {
  const geometry::ElementMap& map = maps_[at(facet)];
  Tangents tangents;
  Vector off;
  bool on_border = false;
  if (map.shape() == Shape::Line) {
    const auto [at, is_end] = foot_on_line(map, point);
    off = point - at.x;
    on_border = is_end;
    tangents = {{at.dt, Vector::Zero()}, 1};
  } else {
    const geometry::ElementFoot found =
        geometry::foot_on_element(map, point, geometry::nearest_node(map, point), kShortStep);
    const geometry::SurfacePoint at = map.at(found.at[0], found.at[1]);
    off = point - found.x;
    on_border = found.on_border;
    tangents = {{at.du, at.dv - at.du * (at.du.dot(at.dv) / at.du.squaredNorm())}, 2};
  }
  const bool leans = on_border && std::ranges::any_of(tangents.all(), [&](const Vector& tangent) {
                       return std::abs(tangent.dot(off)) > kLeans * tangent.norm() * off.norm();
                     });
  return {{off.norm(), leans ? off.stableNormalized() : away_from_wall(off, tangents)}, leans};
}

WallDistance::Distance WallDistance::distance(const Vector& point, std::int32_t facet) const {
  Foot nearest = foot(point, facet);
  if (!nearest.leans) return nearest.distance;
  const WallFacet& wall = columns_.facets[at(facet)];
  for (int v = 0; v < reference::info(wall.shape).vertices; ++v)
    for (const std::int32_t other : columns_.facets_of[at(columns_.column_of[at(wall.nodes[at(v)])])]) {
      if (other == facet) continue;
      const Foot there = foot(point, other);
      if (there.distance.value < nearest.distance.value) nearest = there;
    }
  return nearest.distance;
}

}  // namespace varimesh::detail
