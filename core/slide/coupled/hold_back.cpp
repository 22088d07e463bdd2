#include "core/slide/coupled/hold_back.h"

#include <algorithm>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

constexpr int kMostTries = 24;
/// An element that exceeds the limit goes at most this part of the way that it went.
constexpr double kAtMost = 0.9;
/// How the nodes of an element go that would be folded.
constexpr double kIfFolded = 0.5;
/// If the rms distance is too large, the largest distance of an element falls in proportion, at most to this.
constexpr double kLeastFall = 0.5;
constexpr double kRounding = 1e-9;  // distances that differ by less, relative to themselves, are equal

using Element = BoundaryEnergy::Element;

Distances sum(const std::vector<Element>& elements, bool on_surfaces) {
  Distances sum;
  for (const Element& element : elements)
    if (element.is_on_surface == on_surfaces) sum.add(element.distances);
  return sum;
}

/// The part that an element may go of the way that it went. It may always stay where it was at the start.
double share(const Element& start, const Element& now, double most) {
  double share = !start.is_folded && now.is_folded ? kIfFolded : 1;
  if (now.distances.largest > std::max(most, (1 + kRounding) * start.distances.largest)) {
    const double room = std::max(0.0, most - start.distances.largest);
    share = std::min({share, kAtMost, room / (now.distances.largest - std::min(start.distances.largest, most))});
  }
  return share;
}

}  // namespace

bool hold_back(const CoupledState& start, const CoupledState& end, const DistanceLimit& surfaces,
               const DistanceLimit& curves, CoupledNewton& newton, BoundaryEnergy& boundary) {
  newton.restore(start);
  const std::vector<Element> first = boundary.elements(start.coordinates);
  if (!surfaces.allows(sum(first, true)) || !curves.allows(sum(first, false))) return false;
  std::vector<double> parts(start.coordinates.size() / 3, 1);
  double most_on_surfaces = surfaces.largest, most_on_curves = curves.largest;
  for (int k = 0; k < kMostTries; ++k) {
    newton.put_between(start, end, parts);
    const std::vector<Element> now = boundary.elements(newton.coordinates());
    std::vector<double> shares(parts.size(), 1);
    bool holds = true;
    for (std::size_t e = 0; e < now.size(); ++e) {
      const double own = share(first[e], now[e], now[e].is_on_surface ? most_on_surfaces : most_on_curves);
      if (own == 1) continue;
      holds = false;
      for (const std::int32_t node : now[e].nodes) shares[at(node)] = std::min(shares[at(node)], own);
    }
    for (std::size_t node = 0; node < parts.size(); ++node) parts[node] *= shares[node];
    if (!holds) continue;
    const auto lower = [&](const DistanceLimit& limit, const Distances& distances, double& most) {
      if (limit.allows(distances)) return;
      holds = false;
      most = std::min(most, distances.largest) * std::max(kLeastFall, kAtMost * limit.rms / distances.rms());
    };
    lower(surfaces, sum(now, true), most_on_surfaces);
    lower(curves, sum(now, false), most_on_curves);
    if (holds) return true;
  }
  return false;
}

}  // namespace varimesh::detail
