#include "core/association/match.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "core/geometry/closest_point.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kSamples = 16;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// How well samples fit a surface.
struct Fit {
  double distance = kInfinity;  ///< The largest of a sample.
  std::size_t outside = 0;      ///< How many samples lie outside the surface's boundary.
  int surface = -1;             ///< Index in Geometry::surfaces.
};

/// A surface of the geometry, and how well samples fit it.
class Candidate {
 public:
  explicit Candidate(const geometry::Surface& surface) : shape_(surface.shape.get()), search_(*surface.shape) {}

  /// The distance is infinite if a sample is farther than `limit`, or if half of them or more lie outside the surface's
  /// boundary.
  Fit fit(const std::vector<Eigen::Vector3d>& samples, double limit) const {
    Fit fit;
    fit.distance = 0;
    for (const Eigen::Vector3d& x : samples) {
      const geometry::SurfaceFoot foot = search_.closest(x);
      if (!(foot.distance <= limit)) return {};
      fit.distance = std::max(fit.distance, foot.distance);
      if (!shape_->contains(foot.u, foot.v) && 2 * ++fit.outside >= samples.size()) return {};
    }
    return fit;
  }

 private:
  const geometry::SurfaceShape* shape_;
  geometry::SurfaceSearch search_;
};

/// By tag: up to kSamples nodes that belong to no other surface, or to few if there are none.
std::map<int, std::vector<Eigen::Vector3d>> samples_by_tag(const HighOrderMesh& mesh, const NodeSurfaces& tags) {
  std::map<int, std::vector<std::int32_t>> own, all;
  for (std::size_t node = 0; node < tags.size(); ++node)
    for (const int tag : tags[node]) {
      all[tag].push_back(static_cast<std::int32_t>(node));
      if (tags[node].size() == 1) own[tag].push_back(static_cast<std::int32_t>(node));
    }
  std::map<int, std::vector<Eigen::Vector3d>> samples;
  for (const auto& [tag, nodes] : all) {
    const std::vector<std::int32_t>& from = own[tag].empty() ? nodes : own[tag];
    const std::size_t count = std::min(kSamples, from.size());
    for (std::size_t i = 0; i < count; ++i) {
      const std::int32_t node = from[i * from.size() / count];
      samples[tag].emplace_back(
          Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(node)]));
    }
  }
  return samples;
}

SurfaceMatch match(int tag, const std::vector<Eigen::Vector3d>& samples, const geometry::Geometry& geometry,
                   const std::vector<std::unique_ptr<Candidate>>& candidates, double tolerance) {
  SurfaceMatch result;
  result.tag = tag;
  // Nodes of a mesh generator lie within its tolerance of the surface. Only then does an equal tag decide.
  const double close = 1e-3 * tolerance;
  for (std::size_t s = 0; s < candidates.size(); ++s) {
    if (geometry.surfaces[s].tag != tag) continue;
    result.distance = candidates[s]->fit(samples, close).distance;
    if (result.distance > close) continue;
    result.surface = static_cast<int>(s);
    result.by_tag = true;
    return result;
  }
  std::vector<Fit> fits;
  for (std::size_t s = 0; s < candidates.size(); ++s) {
    const double least = fits.empty() ? tolerance : fits.front().distance;
    Fit fit = candidates[s]->fit(samples, std::min(tolerance, 2 * least + close));
    if (fit.distance == kInfinity) continue;
    fit.surface = static_cast<int>(s);
    fits.push_back(fit);
    std::ranges::stable_sort(fits, {}, &Fit::distance);
  }
  if (fits.empty()) {
    result.distance = kInfinity;
    return result;
  }
  std::erase_if(fits, [most = 2 * fits.front().distance + close](const Fit& one) { return one.distance > most; });
  // Nodes between elements of one surface lie inside its boundary, so a rival that has some of them outside is wrong.
  const auto inside = std::ranges::find(fits, std::size_t{0}, &Fit::outside);
  const bool only_one = inside != fits.end() && std::ranges::count(fits, std::size_t{0}, &Fit::outside) == 1;
  const Fit& best = only_one ? *inside : fits.front();
  result.distance = best.distance;
  (only_one || fits.size() == 1 ? result.surface : result.rival) = best.surface;
  return result;
}

}  // namespace

NodeSurfaces surface_tags_by_node(const HighOrderMesh& mesh) {
  NodeSurfaces tags(mesh.node_count());
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != 2) continue;
    for (const std::int32_t node : block.nodes) {
      std::vector<int>& of = tags[static_cast<std::size_t>(node)];
      const auto place = std::ranges::lower_bound(of, block.entity);
      if (place == of.end() || *place != block.entity) of.insert(place, block.entity);
    }
  }
  return tags;
}

std::vector<bool> border_nodes(const HighOrderMesh& mesh) {
  struct Edge {
    int elements = 0;
    std::vector<std::int32_t> nodes;
  };
  std::map<std::pair<std::int32_t, std::int32_t>, Edge> edges;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != 2) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    const auto facets = static_cast<int>(reference::info(block.shape).facets.size());
    for (std::size_t e = 0; e < block.size(); ++e)
      for (int facet = 0; facet < facets; ++facet) {
        std::vector<std::int32_t> nodes;
        for (const int local : reference::facet_nodes(block.shape, block.order, facet))
          nodes.push_back(block.nodes[e * stride + static_cast<std::size_t>(local)]);
        const auto ends = std::minmax(nodes[0], nodes[1]);
        Edge& edge = edges[{ends.first, ends.second}];
        ++edge.elements;
        edge.nodes = std::move(nodes);
      }
  }
  std::vector<bool> border(mesh.node_count(), false);
  for (const auto& [ends, edge] : edges)
    if (edge.elements == 1)
      for (const std::int32_t node : edge.nodes) border[static_cast<std::size_t>(node)] = true;
  return border;
}

std::vector<SurfaceMatch> match_surfaces(const HighOrderMesh& mesh, const NodeSurfaces& tags,
                                         const geometry::Geometry& geometry, double tolerance, const Team& team) {
  const auto samples = samples_by_tag(mesh, tags);
  std::vector<std::unique_ptr<Candidate>> candidates(geometry.surfaces.size());
  team.for_each(static_cast<std::int32_t>(candidates.size()), 1, [&](std::int32_t s) {
    candidates[static_cast<std::size_t>(s)] =
        std::make_unique<Candidate>(geometry.surfaces[static_cast<std::size_t>(s)]);
  });
  std::vector<std::pair<int, const std::vector<Eigen::Vector3d>*>> order;
  for (const auto& [tag, of_tag] : samples) order.emplace_back(tag, &of_tag);
  std::vector<SurfaceMatch> matches(order.size());
  team.for_each(static_cast<std::int32_t>(order.size()), 1, [&](std::int32_t i) {
    const auto& [tag, of_tag] = order[static_cast<std::size_t>(i)];
    matches[static_cast<std::size_t>(i)] = match(tag, *of_tag, geometry, candidates, tolerance);
  });
  return matches;
}

std::string number_text(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", number);
  return text;
}

}  // namespace varimesh::detail
