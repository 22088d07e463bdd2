#include "core/association/association.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>

#include "core/association/file_parameters.h"
#include "core/association/match.h"
#include "core/association/repeated.h"
#include "core/association/units.h"
#include "core/base/index.h"
#include "core/geometry/closest_point.h"
#include "core/mesh/bounding_box.h"

namespace varimesh {
namespace {

using detail::NodeSurfaces;
using geometry::Geometry;

/// Closer than this to a vertex, relative to the size, a node on several surfaces is that vertex.
constexpr double kVertexTolerance = 1e-6;
/// Two curves whose distances differ by less than this, relative to the size, are equally near.
constexpr double kRivalTolerance = 1e-9;

/// Places nodes on the curves and vertices of a geometry, whose surfaces have been matched.
class Placing {
 public:
  Placing(const HighOrderMesh& mesh, const Association& association)
      : mesh_(mesh), geometry_(association.geometry), size_(association.size), places_(mesh) {
    curves_of_.resize(geometry_.surfaces.size());
    for (const geometry::Curve& curve : geometry_.curves) searches_.emplace_back(*curve.shape);
    for (std::size_t s = 0; s < geometry_.surfaces.size(); ++s) curves_of_[s] = geometry_.surfaces[s].curves;
  }

  /// The entity of a node that lies on elements of the surfaces `surfaces` (sorted).
  NodeEntity entity(std::int32_t node, const std::vector<int>& surfaces) const {
    const Eigen::Vector3d x = position(node);
    std::vector<int> curves;
    for (const int c : curves_of_[at(surfaces.front())])
      if (bounds_all(c, surfaces)) curves.push_back(c);
    if (const auto vertex = vertex_at(x, surfaces); vertex.dimension == 0) return vertex;
    if (const auto known = by_parameters(node, curves); known.dimension == 1) return known;
    NodeEntity best;
    double least = kMatchTolerance * size_, second = least;
    for (const int c : curves) {
      const geometry::CurveFoot foot = searches_[at(c)].closest(x);
      if (foot.distance >= least) {
        second = std::min(second, foot.distance);
        continue;
      }
      second = least;
      least = foot.distance;
      best = {1, c, foot.distance, {foot.t, 0}};
    }
    if (best.dimension >= 0 && second - least >= kRivalTolerance * size_) return best;
    // Bodies that touch in a corner have a vertex each, and no curve or vertex bounds the surfaces of all of them.
    return vertex_at(x, {});
  }

  /// What the file says about the node.
  detail::FilePlace place(std::int32_t node) const { return places_.of(node); }

  /// The foot to which the file's parameters on this surface lead. Its distance is infinite if there is none.
  geometry::SurfaceFoot by_parameters(std::int32_t node, const geometry::SurfaceShape& shape,
                                      const std::vector<int>& tags) const {
    const detail::FilePlace place = places_.of(node);
    if (place.dimension != 2 || !place.has_parameters || std::ranges::find(tags, place.tag) == tags.end())
      return {0, 0, {}, std::numeric_limits<double>::infinity()};
    return detail::foot_at(shape, position(node), place.at, size_);
  }

  Eigen::Vector3d position(std::int32_t node) const {
    return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * at(node)]);
  }

  /// The curve that the node lies on, if the surface lies on both sides of this curve and its parameters do not go on
  /// past it. Otherwise the dimension is −1.
  NodeEntity slit(std::int32_t node, int surface) const {
    const geometry::SurfaceShape& shape = *geometry_.surfaces[at(surface)].shape;
    if (shape.u_range().period > 0 || shape.v_range().period > 0) return {};
    for (const int c : curves_of_[at(surface)]) {
      const geometry::Curve& curve = geometry_.curves[at(c)];
      if (curve.surfaces.size() != 2 || curve.surfaces[0] != curve.surfaces[1]) continue;
      const geometry::CurveFoot foot = searches_[at(c)].closest(position(node));
      if (foot.distance < kVertexTolerance * size_) return {1, c, foot.distance, {foot.t, 0}};
    }
    return {};
  }

 private:
  /// The one of these curves on which the file's parameter leads to the node: that with the file's tag, or else the
  /// only one. Otherwise the dimension is −1.
  NodeEntity by_parameters(std::int32_t node, const std::vector<int>& curves) const {
    const detail::FilePlace place = places_.of(node);
    if (place.dimension != 1 || !place.has_parameters) return {};
    NodeEntity only;
    int found = 0;
    for (const int c : curves) {
      const geometry::Curve& curve = geometry_.curves[at(c)];
      const geometry::CurveFoot foot = detail::foot_at(*curve.shape, position(node), place.at[0], size_);
      if (!std::isfinite(foot.distance)) continue;
      only = {1, c, foot.distance, {foot.t, 0}};
      if (curve.tag == place.tag) return only;
      ++found;
    }
    return found == 1 ? only : NodeEntity{};
  }

  bool bounds_all(int curve, const std::vector<int>& surfaces) const {
    const std::vector<int>& of = geometry_.curves[at(curve)].surfaces;
    return std::ranges::all_of(surfaces, [&](int s) { return std::ranges::find(of, s) != of.end(); });
  }

  /// The vertex at x that lies on all the surfaces, if there are any. The vertex of a closed curve does not count if
  /// only seams end there besides: a node may pass it.
  NodeEntity vertex_at(const Eigen::Vector3d& x, const std::vector<int>& surfaces) const {
    for (std::size_t v = 0; v < geometry_.vertices.size(); ++v) {
      const double distance = (geometry_.vertices[v].x - x).norm();
      if (distance > kVertexTolerance * size_) continue;
      bool passable = surfaces.size() == 2;
      std::vector<int> around;
      for (const geometry::Curve& curve : geometry_.curves) {
        if (std::ranges::find(curve.vertices, static_cast<int>(v)) == curve.vertices.end()) continue;
        around.insert(around.end(), curve.surfaces.begin(), curve.surfaces.end());
        const bool seam = curve.surfaces.size() == 2 && curve.surfaces[0] == curve.surfaces[1];
        passable = passable && (seam || curve.shape->range().period > 0);
      }
      const bool on_all =
          std::ranges::all_of(surfaces, [&](int s) { return std::ranges::find(around, s) != around.end(); });
      if (on_all && !passable) return {0, static_cast<std::int32_t>(v), distance, {}};
    }
    return {};
  }

  const HighOrderMesh& mesh_;
  const Geometry& geometry_;
  double size_;
  detail::FilePlaces places_;
  std::vector<geometry::CurveSearch> searches_;
  std::vector<std::vector<int>> curves_of_;
};

double size_of(const HighOrderMesh& mesh, const NodeSurfaces& nodes) {
  BoundingBox box;
  for (std::size_t node = 0; node < nodes.size(); ++node)
    if (!nodes[node].empty()) box.extend(&mesh.coordinates[3 * node]);
  double square = 0;
  for (std::size_t k = 0; k < 3; ++k) square += std::pow(box.high[k] - box.low[k], 2);
  return std::sqrt(square);
}

/// Samples of a surface may be too far apart to lead to a foot. Then the feet of the nodes nearby lead there.
void find_missed_feet(const Placing& placing, const geometry::SurfaceShape& shape,
                      const std::vector<std::int32_t>& nodes, double tolerance, const Team& team,
                      std::vector<geometry::SurfaceFoot>& feet) {
  constexpr std::size_t kNearest = 8;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    team.look();
    if (feet[i].distance < tolerance) continue;
    const Eigen::Vector3d x = placing.position(nodes[i]);
    std::vector<std::pair<double, std::size_t>> nearby;
    for (std::size_t k = 0; k < nodes.size(); ++k)
      if (feet[k].distance < tolerance) nearby.emplace_back((placing.position(nodes[k]) - x).squaredNorm(), k);
    const std::size_t count = std::min(kNearest, nearby.size());
    std::partial_sort(nearby.begin(), nearby.begin() + static_cast<std::ptrdiff_t>(count), nearby.end());
    for (std::size_t k = 0; k < count && !(feet[i].distance < tolerance); ++k) {
      const geometry::SurfaceFoot& from = feet[nearby[k].second];
      const geometry::SurfaceFoot foot = geometry::closest_from(shape, x, from.u, from.v);
      if (foot.distance < feet[i].distance) feet[i] = foot;
    }
  }
}

/// The feet of the nodes of a surface: by the file's parameters, or else by projection.
/// @param tags  those of the mesh's surfaces that lie on it
std::vector<geometry::SurfaceFoot> feet_of(const Placing& placing, const geometry::SurfaceShape& shape,
                                           const std::vector<std::int32_t>& nodes, const std::vector<int>& tags,
                                           double tolerance, const Team& team) {
  std::vector<geometry::SurfaceFoot> feet(nodes.size());
  const auto for_nodes = [&](const auto& body) {
    team.for_each(static_cast<std::int32_t>(nodes.size()), 16,
                  [&](std::int32_t i) { body(nodes[at(i)], feet[at(i)]); });
  };
  const auto is_missing = [](const geometry::SurfaceFoot& foot) { return !std::isfinite(foot.distance); };
  for_nodes([&](std::int32_t node, auto& foot) { foot = placing.by_parameters(node, shape, tags); });
  if (std::ranges::any_of(feet, is_missing)) {
    const geometry::SurfaceSearch search(shape);  // samples the whole surface
    for_nodes([&](std::int32_t node, auto& foot) {
      if (is_missing(foot)) foot = search.closest(placing.position(node));
    });
  }
  find_missed_feet(placing, shape, nodes, tolerance, team, feet);
  return feet;
}

/// Counts the nodes that the file's parameters have placed, and names those to which they do not lead.
void judge_parameters(const Placing& placing, Association& result) {
  for (std::size_t node = 0; node < result.nodes.size(); ++node) {
    const detail::FilePlace place = placing.place(static_cast<std::int32_t>(node));
    const NodeEntity& entity = result.nodes[node];
    if (!place.has_parameters || entity.dimension != place.dimension) continue;
    const Eigen::Vector3d x = placing.position(static_cast<std::int32_t>(node));
    const auto index = at(entity.entity);
    const double distance =
        entity.dimension == 1
            ? detail::foot_at(*result.geometry.curves[index].shape, x, place.at[0], result.size).distance
            : detail::foot_at(*result.geometry.surfaces[index].shape, x, place.at, result.size).distance;
    if (std::isfinite(distance))
      ++result.by_parameters;
    else
      result.misled.push_back(static_cast<std::int32_t>(node));
  }
}

/// By node: the sorted surfaces on whose elements it lies, with −1 before them if one of the elements lies on none.
std::vector<std::vector<int>> surfaces_by_node(const HighOrderMesh& mesh, const Association& association) {
  std::vector<std::vector<int>> surfaces(mesh.node_count());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const std::vector<int>& of = association.surface_of_element[b];
    const std::size_t stride = of.empty() ? 0 : mesh.blocks[b].nodes.size() / of.size();
    for (std::size_t k = 0; k < of.size() * stride; ++k) {
      std::vector<int>& own = surfaces[at(mesh.blocks[b].nodes[k])];
      const auto place = std::ranges::lower_bound(own, of[k / stride]);
      if (place == own.end() || *place != of[k / stride]) own.insert(place, of[k / stride]);
    }
  }
  return surfaces;
}

/// By surface: the tags of the mesh's surfaces whose elements lie on it.
std::vector<std::vector<int>> tags_by_surface(const HighOrderMesh& mesh, const Association& association) {
  std::vector<std::set<int>> tags(association.geometry.surfaces.size());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    for (const int s : association.surface_of_element[b])
      if (s >= 0) tags[at(s)].insert(mesh.blocks[b].entity);
  std::vector<std::vector<int>> result;
  for (const std::set<int>& of : tags) result.emplace_back(of.begin(), of.end());
  return result;
}

/// Returns the tags of the mesh's surfaces that have nodes elsewhere than on the surface on which they should lie.
std::vector<int> place_nodes(const HighOrderMesh& mesh, const NodeSurfaces& tags, const Team& team,
                             Association& result) {
  const auto surfaces = surfaces_by_node(mesh, result);
  const auto tags_on = tags_by_surface(mesh, result);
  result.surfaces.assign(result.geometry.surfaces.size(), {});
  result.held.clear();
  for (std::size_t node = 0; node < surfaces.size(); ++node)
    for (const int s : surfaces[node])
      if (s >= 0) result.surfaces[at(s)].nodes.push_back(static_cast<std::int32_t>(node));
  const Placing placing(mesh, result);
  const std::vector<bool> border = detail::border_nodes(mesh);
  result.nodes.assign(mesh.node_count(), {});
  team.for_each(static_cast<std::int32_t>(mesh.node_count()), 64, [&](std::int32_t node) {
    const std::vector<int>& on = surfaces[at(node)];
    if (on.empty() || on.front() < 0) return;
    if (on.size() > 1 || border[at(node)]) result.nodes[at(node)] = placing.entity(node, on);
  });
  team.for_each(static_cast<std::int32_t>(result.surfaces.size()), 1, [&](std::int32_t s) {
    SurfaceNodes& own = result.surfaces[at(s)];
    if (own.nodes.empty()) return;
    const geometry::SurfaceShape& shape = *result.geometry.surfaces[at(s)].shape;
    const auto feet = feet_of(placing, shape, own.nodes, tags_on[at(s)], kMatchTolerance * result.size, team);
    for (std::size_t i = 0; i < own.nodes.size(); ++i) {
      const std::int32_t node = own.nodes[i];
      const geometry::SurfaceFoot& foot = feet[i];
      own.parameters.push_back({foot.u, foot.v});
      if (surfaces[at(node)].size() != 1 || border[at(node)]) continue;
      NodeEntity& entity = result.nodes[at(node)];
      entity = placing.slit(node, s);
      if (entity.dimension < 0 && foot.distance < kMatchTolerance * result.size)
        entity = {2, s, foot.distance, {foot.u, foot.v}};
    }
  });
  std::set<int> astray;
  for (std::size_t node = 0; node < tags.size(); ++node) {
    if (tags[node].empty() || result.nodes[node].dimension >= 0) continue;
    result.held.push_back(static_cast<std::int32_t>(node));
    if (surfaces[node].size() == 1 && surfaces[node].front() >= 0 && !border[node])
      astray.insert(tags[node].begin(), tags[node].end());
  }
  result.by_parameters = 0;
  result.misled.clear();
  judge_parameters(placing, result);
  return {astray.begin(), astray.end()};
}

/// Places the nodes again if faces of touching bodies overlap at nodes that belong to no curve and no vertex.
void place_between_overlaps(const HighOrderMesh& mesh, const NodeSurfaces& tags, const Team& team, Association& result,
                            std::vector<int>& astray) {
  if (result.held.empty()) return;
  const auto surfaces = surfaces_by_node(mesh, result);
  std::vector<detail::CommonPoint> points;
  for (const std::int32_t node : result.held) {
    const std::vector<int>& on = surfaces[at(node)];
    if (on.size() < 2 || on.front() < 0) continue;
    detail::CommonPoint& point = points.emplace_back();
    point.x = Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * at(node)]);
    point.surfaces = on;
    for (const int s : on) point.feet.push_back(result.surfaces[at(s)].of(node));
  }
  if (points.empty()) return;
  if (detail::complete_at(result.geometry, points, kVertexTolerance * result.size) > 0)
    astray = place_nodes(mesh, tags, team, result);
}

/// Matches the mesh with the geometry in another unit of length.
/// @param geometry  without what bodies repeat
/// @param part_of   Repeated::part_of
struct Attempt {
  Attempt(const HighOrderMesh& mesh, const NodeSurfaces& tags, const Geometry& geometry,
          const std::vector<std::vector<int>>& part_of, double factor, double tolerance, const Team& team)
      : factor(factor),
        geometry(std::make_unique<Geometry>(factor == 1 ? geometry : geometry::scaled(geometry, factor))),
        candidates(std::make_unique<detail::Candidates>(*this->geometry, part_of, team)),
        matching(detail::match_surfaces(mesh, tags, *candidates, tolerance, team)) {}

  std::int64_t elements() const {
    std::int64_t sum = 0;
    for (const SurfaceMatch& match : matching.matches) sum += match.elements;
    return sum;
  }
  /// How many surfaces of the mesh match.
  std::ptrdiff_t surfaces() const {
    return std::ranges::count_if(matching.matches, [](const SurfaceMatch& one) { return one.on_none < one.elements; });
  }

  double factor;
  std::unique_ptr<Geometry> geometry;  ///< To which the candidates refer.
  std::unique_ptr<detail::Candidates> candidates;
  detail::Matching matching;
};

}  // namespace

std::array<double, 2>& SurfaceNodes::of(std::int32_t node) {
  return parameters[at(std::ranges::lower_bound(nodes, node) - nodes.begin())];
}

Expected<Association> associate(const HighOrderMesh& mesh, const geometry::Geometry& geometry, const Team& team) {
  const NodeSurfaces tags = detail::surface_tags_by_node(mesh);
  Association result;
  result.size = size_of(mesh, tags);
  if (!(result.size > 0) || !std::isfinite(result.size))
    return bad_input(
        "The mesh has no elements on its surfaces, so it cannot be matched with a geometry. Write it with all elements "
        "(in Gmsh: Mesh.SaveAll, or physical groups of the surfaces).");
  const double geometry_size = geometry::size(geometry), tolerance = kMatchTolerance * result.size;
  Geometry once = geometry;
  const detail::Repeated repeated = detail::merge_repeated(once, kVertexTolerance * geometry_size, team);
  result.repeated = repeated.surfaces;
  Attempt best(mesh, tags, once, repeated.part_of, 1, tolerance, team);
  const double factor = detail::unit_factor(result.size, geometry_size);
  if (factor != 1 && best.matching.matched < best.elements()) {
    Attempt other(mesh, tags, once, repeated.part_of, factor, tolerance, team);
    if (other.matching.matched > best.matching.matched) best = std::move(other);
  }
  // Parts of another size may match by chance, a plane for example. Then the factor is no unit.
  const auto all = std::ssize(best.matching.matches), matched = best.surfaces();
  if (matched == 0 || (best.factor != 1 && 2 * matched < all))
    return bad_input(
        (matched == 0 ? "No surface" : "Only " + std::to_string(matched) + " of " + std::to_string(all) + " surfaces") +
        " of the mesh " + (matched > 1 ? "lie" : "lies") + " on a surface of the geometry. The mesh is " +
        detail::number_text(result.size) + " across and the geometry " + detail::number_text(geometry_size) +
        "; check that they belong together and have the same origin and unit of length.");
  result.factor = best.factor;
  result.geometry = *best.geometry;
  result.matches = std::move(best.matching.matches);
  result.surface_of_element = std::move(best.matching.surface_of_element);
  std::vector<int> astray = place_nodes(mesh, tags, team, result);
  place_between_overlaps(mesh, tags, team, result, astray);
  if (astray.empty()) return result;
  const auto before = result.surface_of_element;
  detail::match_elements(mesh, astray, *best.candidates, tolerance, team, result.surface_of_element);
  if (result.surface_of_element != before) place_nodes(mesh, tags, team, result);
  return result;
}

std::size_t snap(HighOrderMesh& mesh, Association& association, double tolerance) {
  std::size_t moved = 0;
  for (std::size_t node = 0; node < association.nodes.size(); ++node) {
    NodeEntity& entity = association.nodes[node];
    if (entity.dimension < 0 || entity.distance <= tolerance * association.size) continue;
    const auto index = at(entity.entity);
    const geometry::Geometry& geometry = association.geometry;
    const Eigen::Vector3d x = entity.dimension == 0 ? geometry.vertices[index].x
                              : entity.dimension == 1
                                  ? geometry.curves[index].shape->at(entity.at[0]).x
                                  : geometry.surfaces[index].shape->at(entity.at[0], entity.at[1]).x;
    Eigen::Map<Eigen::Vector3d>(&mesh.coordinates[3 * node]) = x;
    entity.distance = 0;
    ++moved;
  }
  return moved;
}

}  // namespace varimesh
