#include "core/association/match.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <set>
#include <utility>

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

/// Nodes of a surface of the mesh.
struct Samples {
  std::vector<Eigen::Vector3d> some;  ///< Up to kSamples that belong to no other surface, or to few if there are none.
  std::vector<Eigen::Vector3d> border;  ///< All that belong to another surface too.
};

/// The distance is infinite if a sample is farther than `limit`, or if half of them or more lie outside the surface's
/// boundary. In a coarse ring or band they may, since edges across it leave it. Then its border decides.
/// @param close  the largest distance of a border that decides
Fit fit_of(const Candidates& candidates, std::size_t s, const Samples& samples, double limit, double close) {
  Fit fit;
  fit.distance = 0;
  fit.surface = static_cast<int>(s);
  for (const Eigen::Vector3d& x : samples.some) {
    const geometry::SurfaceFoot foot = candidates.closest(s, x);
    if (!(foot.distance <= limit)) return {};
    fit.distance = std::max(fit.distance, foot.distance);
    if (!candidates.surface(s).shape->contains(foot.u, foot.v)) ++fit.outside;
  }
  if (fit.outside == 0) return fit;
  if (fit.distance <= close && candidates.is_border(s, samples.border, close)) fit.outside = 0;
  return 2 * fit.outside < samples.some.size() ? fit : Fit{};
}

std::map<int, Samples> samples_by_tag(const HighOrderMesh& mesh, const NodeSurfaces& tags) {
  std::map<int, std::vector<std::int32_t>> own, all;
  for (std::size_t node = 0; node < tags.size(); ++node)
    for (const int tag : tags[node]) {
      all[tag].push_back(static_cast<std::int32_t>(node));
      if (tags[node].size() == 1) own[tag].push_back(static_cast<std::int32_t>(node));
    }
  const auto position = [&](std::int32_t node) {
    return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(node)]);
  };
  std::map<int, Samples> samples;
  for (const auto& [tag, nodes] : all) {
    const std::vector<std::int32_t>& from = own[tag].empty() ? nodes : own[tag];
    const std::size_t count = std::min(kSamples, from.size());
    for (std::size_t i = 0; i < count; ++i) samples[tag].some.emplace_back(position(from[i * from.size() / count]));
    for (const std::int32_t node : nodes)
      if (tags[static_cast<std::size_t>(node)].size() > 1) samples[tag].border.emplace_back(position(node));
  }
  return samples;
}

SurfaceMatch match(int tag, const Samples& samples, const Candidates& candidates, double tolerance) {
  SurfaceMatch result;
  result.tag = tag;
  // Nodes of a mesh generator lie within its tolerance of the surface. Only then does an equal tag decide.
  const double close = 1e-3 * tolerance;
  for (std::size_t s = 0; s < candidates.count(); ++s) {
    if (candidates.surface(s).tag != tag) continue;
    result.distance = fit_of(candidates, s, samples, close, close).distance;
    if (result.distance > close) continue;
    result.surface = static_cast<int>(s);
    result.by_tag = true;
    return result;
  }
  std::vector<Fit> fits;
  for (std::size_t s = 0; s < candidates.count(); ++s) {
    const double least = fits.empty() ? tolerance : fits.front().distance;
    const Fit fit = fit_of(candidates, s, samples, std::min(tolerance, 2 * least + close), close);
    if (fit.distance == kInfinity) continue;
    fits.push_back(fit);
    std::ranges::stable_sort(fits, {}, &Fit::distance);
  }
  if (fits.empty()) {
    result.distance = kInfinity;
    return result;
  }
  std::erase_if(fits, [most = 2 * fits.front().distance + close](const Fit& one) { return one.distance > most; });
  // Nodes between elements of one surface lie inside its boundary, so a rival that has some of them outside is wrong.
  std::vector<int> inside;
  for (const Fit& one : fits)
    if (one.outside == 0) inside.push_back(one.surface);
  candidates.keep_parts(inside);
  const bool only_one = inside.size() == 1;
  const Fit& best = only_one ? *std::ranges::find(fits, inside.front(), &Fit::surface) : fits.front();
  result.distance = best.distance;
  (only_one || fits.size() == 1 ? result.surface : result.rival) = best.surface;
  return result;
}

/// Counts what lies on no surface.
void count_elements(const HighOrderMesh& mesh, Matching& result) {
  std::map<int, SurfaceMatch*> match_of;
  for (SurfaceMatch& match : result.matches) {
    match_of[match.tag] = &match;
    match.elements = match.on_none = 0;
  }
  result.matched = 0;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const std::vector<int>& surfaces = result.surface_of_element[b];
    if (surfaces.empty()) continue;
    SurfaceMatch& match = *match_of.at(mesh.blocks[b].entity);
    const std::int64_t none = std::ranges::count(surfaces, -1);
    match.elements += std::ssize(surfaces);
    match.on_none += none;
    result.matched += std::ssize(surfaces) - none;
  }
}

/// A few elements may lie on a surface by chance: on a plane, for example, to which another body reaches. So the
/// elements of a surface of the mesh count only if half of them lie on the geometry, or if they lie on several surfaces
/// of it.
void forget_chance(const HighOrderMesh& mesh, const std::vector<std::vector<int>>& whole, Matching& result) {
  for (const SurfaceMatch& match : result.matches) {
    if (match.surface >= 0 || 2 * match.on_none <= match.elements) continue;
    std::set<int> on;
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
      if (mesh.blocks[b].entity == match.tag)
        on.insert(result.surface_of_element[b].begin(), result.surface_of_element[b].end());
    on.erase(-1);
    if (on.size() > 1) continue;
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
      if (mesh.blocks[b].entity == match.tag) result.surface_of_element[b] = whole[b];
  }
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

Candidates::Candidates(const geometry::Geometry& geometry, std::vector<std::vector<int>> part_of, const Team& team)
    : geometry_(geometry),
      part_of_(std::move(part_of)),
      searches_(geometry.surfaces.size()),
      curves_(geometry.curves.size()),
      boxes_(geometry.surfaces.size()) {
  team.for_each(static_cast<std::int32_t>(searches_.size()), 1, [&](std::int32_t i) {
    const auto s = static_cast<std::size_t>(i);
    searches_[s] = std::make_unique<geometry::SurfaceSearch>(*geometry_.surfaces[s].shape);
    boxes_[s] = searches_[s]->box();
  });
  team.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t i) {
    const auto c = static_cast<std::size_t>(i);
    curves_[c] = std::make_unique<geometry::CurveSearch>(*geometry_.curves[c].shape);
  });
}

bool Candidates::holds(std::size_t s, const Eigen::Vector3d& x, double tolerance) const {
  const geometry::SurfaceFoot foot = closest(s, x);
  return surface(s).shape->contains(foot.u, foot.v) || std::ranges::any_of(surface(s).curves, [&](int c) {
           return curves_[static_cast<std::size_t>(c)]->closest(x).distance <= tolerance;
         });
}

bool Candidates::is_border(std::size_t s, std::span<const Eigen::Vector3d> nodes, double tolerance) const {
  const auto lies_on = [&](const Eigen::Vector3d& x, int c) {
    return curves_[static_cast<std::size_t>(c)]->closest(x).distance <= tolerance;
  };
  const std::vector<int>& curves = surface(s).curves;
  const auto is_seam = [&](int c) {
    return std::ranges::count(geometry_.curves[static_cast<std::size_t>(c)].surfaces, static_cast<int>(s)) > 1;
  };
  return !nodes.empty() && std::ranges::all_of(nodes, [&](const Eigen::Vector3d& x) {
    return std::ranges::any_of(curves, [&](int c) { return lies_on(x, c); });
  }) && std::ranges::all_of(curves, [&](int c) {
    return is_seam(c) || std::ranges::any_of(nodes, [&](const Eigen::Vector3d& x) { return lies_on(x, c); });
  });
}

void Candidates::keep_parts(std::vector<int>& surfaces) const {
  const std::vector<int> all = surfaces;
  std::erase_if(surfaces, [&](int whole) {
    return std::ranges::any_of(all, [&](int s) {
      const std::vector<int>& wholes = part_of_[static_cast<std::size_t>(s)];
      return std::ranges::find(wholes, whole) != wholes.end();
    });
  });
}

Matching match_surfaces(const HighOrderMesh& mesh, const NodeSurfaces& tags, const Candidates& candidates,
                        double tolerance, const Team& team) {
  const auto samples = samples_by_tag(mesh, tags);
  std::vector<std::pair<int, const Samples*>> order;
  for (const auto& [tag, of_tag] : samples) order.emplace_back(tag, &of_tag);
  Matching result;
  result.matches.resize(order.size());
  team.for_each(static_cast<std::int32_t>(order.size()), 1, [&](std::int32_t i) {
    const auto& [tag, of_tag] = order[static_cast<std::size_t>(i)];
    result.matches[static_cast<std::size_t>(i)] = match(tag, *of_tag, candidates, tolerance);
  });
  std::map<int, int> surface_of;
  std::vector<int> failed;
  for (const SurfaceMatch& match : result.matches) {
    surface_of[match.tag] = match.surface;
    if (match.surface < 0) failed.push_back(match.tag);
  }
  for (const ElementBlock& block : mesh.blocks) {
    const bool counts = reference::info(block.shape).dimension == 2;
    result.surface_of_element.emplace_back(counts ? block.size() : 0, counts ? surface_of[block.entity] : -1);
  }
  if (!failed.empty()) {
    const auto whole = result.surface_of_element;
    match_elements(mesh, failed, candidates, tolerance, team, result.surface_of_element);
    count_elements(mesh, result);
    forget_chance(mesh, whole, result);
  }
  count_elements(mesh, result);
  return result;
}

std::string number_text(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", number);
  return text;
}

}  // namespace varimesh::detail
