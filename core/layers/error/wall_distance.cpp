#include "core/layers/error/wall_distance.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/index.h"
#include "core/geometry/foot_on_element.h"
#include "core/layers/facet_table.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

constexpr int kMostSteps = 40;
constexpr double kSettled = 1e-14;  ///< A step that is this small in reference coordinates is the last.

/// The point of a line that is nearest to `point`, as far as Newton's method finds it from the nearest node.
std::pair<double, bool> foot_on_line(const geometry::ElementMap& map, const Vector& point) {
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
  return {(now.x - point).norm(), std::abs(xi) > 1 - 1e-9};
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
  if (map.shape() == Shape::Line) {
    const auto [distance, on_border] = foot_on_line(map, point);
    return {distance, on_border};
  }
  const geometry::ElementFoot found = geometry::foot_on_element(map, point, geometry::nearest_node(map, point));
  return {found.distance, found.on_border};
}

double WallDistance::distance(const Vector& point, std::int32_t facet) const {
  Foot nearest = foot(point, facet);
  if (!nearest.on_border) return nearest.distance;
  const WallFacet& wall = columns_.facets[at(facet)];
  for (int v = 0; v < reference::info(wall.shape).vertices; ++v)
    for (const std::int32_t other : columns_.facets_of[at(columns_.column_of[at(wall.nodes[at(v)])])])
      if (other != facet) nearest.distance = std::min(nearest.distance, foot(point, other).distance);
  return nearest.distance;
}

}  // namespace varimesh::detail
