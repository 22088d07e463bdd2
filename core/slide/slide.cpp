#include "core/slide/slide.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <set>

#include "core/geometry/closest_point.h"
#include "core/slide/between_nodes.h"
#include "core/slide/entity_newton.h"
#include "core/slide/periodic_pairs.h"

namespace varimesh {
namespace {

using detail::Distances;
using detail::EntityElement;
using detail::EntityNode;
using detail::EntitySlide;

constexpr int kMostIterations = 60;
/// How much of the way to its optimum an entity's nodes may go.
constexpr double kParts[] = {1, 0.5, 0.25, 0.125};
/// Nodes that are nearer to their optimum than this, relative to the distance between nodes, stand at it already:
/// whether they may move the rest of the way makes no difference.
constexpr double kAtOptimum = 0.02;
/// Distances that differ by less than this, relative to the mesh's size, are equal: rounding.
constexpr double kRounding = 1e-12;

Eigen::Map<Eigen::Vector3d> place(std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<Eigen::Vector3d>(&coordinates[3 * static_cast<std::size_t>(node)]);
}

/// What one entity came to.
struct Outcome {
  Distances after;
  std::int64_t folded_after = 0;
  bool moved = false, held_back = false;
  std::vector<EntityNode> nodes;
};

/// What the distances of an entity may not exceed, up to rounding.
struct Limit {
  double largest = 0, rms = 0;

  /// @param allowed  by entity; empty: nothing beyond `before`
  static Limit of(const Distances& before, const std::vector<geometry::InterpolationError>& allowed,
                  std::size_t entity) {
    Limit limit{before.largest, before.rms()};
    if (allowed.empty()) return limit;
    return {std::max(limit.largest, allowed[entity].largest), std::max(limit.rms, allowed[entity].rms)};
  }
};

/// What a surface was like when the mesh came, and what its nodes may not exceed.
struct Start {
  Distances distances;
  Limit limit;
  std::int64_t folded = 0;
};

class Sliding {
 public:
  Sliding(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed, const Team& team)
      : mesh_(mesh),
        association_(association),
        fixed_(fixed),
        team_(team),
        at_start_(mesh.coordinates),
        nodes_at_start_(association.nodes),
        surfaces_at_start_(association.surfaces),
        curve_elements_(detail::curve_elements(mesh, association)),
        surface_elements_(detail::surface_elements(mesh, association)),
        curves_(curve_elements_.size()),
        surfaces_(surface_elements_.size()),
        curves_at_start_(curve_elements_.size()),
        start_(surface_elements_.size()) {}

  SlideReport run(SlideOn what) {
    std::vector<int> all;
    // In a plane, all nodes move when the mesh is optimised.
    for (std::size_t s = 0; s < surfaces_.size() && !association_.in_plane; ++s)
      if (!surface_elements_[s].empty()) all.push_back(static_cast<int>(s));
    measure_start(all);
    if (what != SlideOn::None && what != SlideOn::Surfaces)
      slide_curves(fixed_);
    else if (association_.in_plane)
      slide_curves(std::vector<bool>(mesh_.node_count(), true));  // measures them
    if (what != SlideOn::None) slide_surfaces(all);
    // The nodes of a curve may have left a surface worse than it came. Then they go back, and the surfaces around try
    // again. Each time fewer curves have moved, so this ends.
    for (std::vector<int> blamed = blamed_curves(); !blamed.empty(); blamed = blamed_curves())
      slide_surfaces(put_back(blamed));
    return report();
  }

 private:
  void measure_start(const std::vector<int>& all) {
    const std::vector<bool> none_moves(mesh_.node_count(), true);
    team_.for_each(static_cast<std::int32_t>(all.size()), 1, [&](std::int32_t i) {
      const int s = all[index(i)];
      const auto nodes = detail::surface_nodes(s, association_, mesh_.coordinates, none_moves);
      Outcome& outcome = surfaces_[index(s)];
      outcome.after = distances(s, nodes, mesh_.coordinates);
      outcome.folded_after = slid(s, nodes, 0).folded_before;
      start_[index(s)] = {outcome.after, Limit::of(outcome.after, association_.allowed_on_surfaces, index(s)),
                          outcome.folded_after};
    });
  }

  EntitySlide slid(int s, const std::vector<EntityNode>& nodes, int iterations) const {
    return detail::slide_on_surface(s, surface_elements_[index(s)], mesh_.order, association_, at_start_, nodes,
                                    iterations, team_);
  }
  Distances distances(int s, const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) const {
    return detail::surface_distances(*association_.geometry.surfaces[index(s)].shape, surface_elements_[index(s)],
                                     mesh_.order, nodes, coordinates, team_);
  }

  // ===== Curves =====

  void slide_curves(const std::vector<bool>& fixed) {
    team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
      const auto& own = curve_elements_[index(c)];
      if (own.empty()) return;
      const geometry::CurveShape& shape = *association_.geometry.curves[index(c)].shape;
      const auto measure = [&](const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
        return detail::curve_distances(shape, own, mesh_.order, nodes, coordinates, team_);
      };
      const auto start = detail::curve_nodes(c, own, association_, mesh_.coordinates, fixed);
      const Distances before = measure(start, at_start_);
      curves_at_start_[index(c)] = before;
      curves_[index(c)] = choose(
          start, before, Limit::of(before, association_.allowed_on_curves, index(c)),
          [&](const std::vector<EntityNode>& nodes, int iterations) {
            return detail::slide_on_curve(c, own, mesh_.order, association_, at_start_, nodes, iterations, team_);
          },
          [&](const EntityNode& from, const EntityNode& to, double part) {
            EntityNode node = to;
            node.at[0] = from.at[0] + part * (to.at[0] - from.at[0]);
            node.x = shape.at(node.at[0]).x;
            return node;
          },
          [](const EntityNode&) { return true; }, measure);
    });
    for (const Outcome& outcome : curves_) take(outcome);
    follow_curves();
  }

  void take(const Outcome& outcome) {
    if (!outcome.moved) return;
    for (const EntityNode& node : outcome.nodes) {
      if (!node.free) continue;
      place(mesh_.coordinates, node.node) = node.x;
      association_.nodes[index(node.node)].at = node.at;
      association_.nodes[index(node.node)].distance = 0;
    }
  }

  /// The parameters, on the surfaces, of the nodes that moved on curves.
  void follow_curves() {
    team_.for_each(static_cast<std::int32_t>(association_.surfaces.size()), 1, [&](std::int32_t s) {
      SurfaceNodes& own = association_.surfaces[index(s)];
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[index(s)].shape;
      std::optional<geometry::SurfaceSearch> search;  // samples the whole surface, and few nodes need it
      for (std::size_t i = 0; i < own.nodes.size(); ++i) {
        const Eigen::Vector3d x = place(mesh_.coordinates, own.nodes[i]), old = place(at_start_, own.nodes[i]);
        if (x == old) continue;
        geometry::SurfaceFoot foot = geometry::closest_from(shape, x, own.parameters[i][0], own.parameters[i][1]);
        if (foot.distance > 0.5 * (x - old).norm()) {
          if (!search) search.emplace(shape);
          foot = search->closest(x);
        }
        own.parameters[i] = {foot.u, foot.v};
      }
    });
  }

  /// The curves that have moved and bound a surface that is now worse than it came.
  std::vector<int> blamed_curves() const {
    std::set<int> blamed;
    const double rounding = kRounding * association_.size;
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      const Outcome& now = surfaces_[s];
      const Start& start = start_[s];
      if (now.after.largest <= start.limit.largest + rounding && now.after.rms() <= start.limit.rms + rounding &&
          now.folded_after <= start.folded)
        continue;
      for (const int c : association_.geometry.surfaces[s].curves)
        if (curves_[index(c)].moved) blamed.insert(c);
    }
    return {blamed.begin(), blamed.end()};
  }

  /// Puts the nodes of the curves back, and those of the surfaces around. Returns these surfaces.
  std::vector<int> put_back(const std::vector<int>& curves) {
    std::set<int> around;
    for (const int c : curves) {
      Outcome& outcome = curves_[index(c)];
      outcome.moved = false;
      outcome.held_back = true;
      for (const EntityNode& node : outcome.nodes)
        if (node.free) put_back(node.node);
      const std::vector<int>& surfaces = association_.geometry.curves[index(c)].surfaces;
      around.insert(surfaces.begin(), surfaces.end());
    }
    std::vector<int> result;
    for (const int s : around) {
      if (surface_elements_[index(s)].empty()) continue;
      result.push_back(s);
      SurfaceNodes& own = association_.surfaces[index(s)];
      for (std::size_t i = 0; i < own.nodes.size(); ++i) {
        const NodeEntity& entity = association_.nodes[index(own.nodes[i])];
        if (entity.dimension == 2) put_back(own.nodes[i]);
        if (place(mesh_.coordinates, own.nodes[i]) == place(at_start_, own.nodes[i]))
          own.parameters[i] = surfaces_at_start_[index(s)].parameters[i];
      }
    }
    return result;
  }
  void put_back(std::int32_t node) {
    place(mesh_.coordinates, node) = place(at_start_, node);
    association_.nodes[index(node)] = nodes_at_start_[index(node)];
  }

  // ===== Surfaces =====

  void slide_surfaces(const std::vector<int>& which) {
    team_.for_each(static_cast<std::int32_t>(which.size()), 1, [&](std::int32_t i) {
      const int s = which[index(i)];
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[index(s)].shape;
      const auto nodes = detail::surface_nodes(s, association_, mesh_.coordinates, fixed_);
      const Distances entry = distances(s, nodes, mesh_.coordinates);
      surfaces_[index(s)] = choose(
          nodes, entry, start_[index(s)].limit,
          [&](const std::vector<EntityNode>& from, int iterations) { return slid(s, from, iterations); },
          [&](const EntityNode& from, const EntityNode& to, double part) { return between(shape, from, to, part); },
          [&](const EntityNode& node) { return shape.contains(node.at[0], node.at[1]); },
          [&](const std::vector<EntityNode>& at, const std::vector<double>& coordinates) {
            return distances(s, at, coordinates);
          });
    });
    for (const int s : which) {
      const Outcome& outcome = surfaces_[index(s)];
      take(outcome);
      if (!outcome.moved) continue;
      for (const EntityNode& node : outcome.nodes)
        if (node.free) association_.surfaces[index(s)].of(node.node) = node.at;
    }
  }

  // ===== Curves and surfaces =====

  /// Slides the nodes of one entity, and takes the largest part of the way on which the number of folded elements does
  /// not rise, the distances exceed neither those that the nodes have now nor the limit, and no node leaves the entity.
  /// @param entry  distances where the nodes are now
  template <class Slide, class PartWay, class Inside, class Measure>
  Outcome choose(const std::vector<EntityNode>& now, const Distances& entry, const Limit& limit,
                 const Slide& slide_nodes, const PartWay& part_way, const Inside& inside, const Measure& measure) {
    const EntitySlide slide = slide_nodes(now, kMostIterations);
    Outcome outcome{entry, slide.folded_before, false, false, now};
    if (slide.iterations == 0) return outcome;
    const bool is_held = slide.farthest > kAtOptimum;
    std::vector<double> coordinates = mesh_.coordinates;
    const double rounding = kRounding * association_.size;
    const double most_largest = std::max(entry.largest, limit.largest) + rounding;
    const double most_rms = std::max(entry.rms(), limit.rms) + rounding;
    for (const double part : kParts) {
      std::vector<EntityNode> nodes = now;
      bool moves = false;
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (!nodes[i].free || slide.nodes[i].at == now[i].at) continue;  // nodes at poles stay as they are, too
        moves = true;
        nodes[i] = part == 1 ? slide.nodes[i] : part_way(now[i], slide.nodes[i], part);
        place(coordinates, nodes[i].node) = nodes[i].x;
      }
      if (!moves) return outcome;
      if (leaves(now, nodes, inside)) continue;
      const Distances after = measure(nodes, coordinates);
      if (after.largest > most_largest || after.rms() > most_rms) continue;
      const std::int64_t folded = part == 1 ? slide.folded_after : slide_nodes(nodes, 0).folded_before;
      if (folded > outcome.folded_after) continue;
      return {after, folded, true, part < 1 && is_held, std::move(nodes)};
    }
    outcome.held_back = is_held;
    return outcome;
  }

  /// The node that has gone a part of the way on a surface.
  static EntityNode between(const geometry::SurfaceShape& shape, const EntityNode& from, const EntityNode& to,
                            double part) {
    EntityNode node = to;
    if (shape.pieces() != nullptr) {
      const Eigen::Vector3d wish = from.x + part * (to.x - from.x);
      const geometry::SurfaceFoot foot = geometry::closest_from(shape, wish, from.at[0], from.at[1]);
      node.at = {foot.u, foot.v};
    } else {
      for (std::size_t k = 0; k < 2; ++k) node.at[k] = from.at[k] + part * (to.at[k] - from.at[k]);
    }
    node.x = shape.at(node.at[0], node.at[1]).x;
    return node;
  }

  /// Whether a free node that was inside the entity's boundary is outside now.
  template <class Inside>
  static bool leaves(const std::vector<EntityNode>& before, const std::vector<EntityNode>& after,
                     const Inside& inside) {
    for (std::size_t i = 0; i < after.size(); ++i)
      if (after[i].free && !inside(after[i]) && inside(before[i])) return true;
    return false;
  }

  static std::size_t index(std::int32_t node) { return static_cast<std::size_t>(node); }

  SlideReport report() {
    SlideReport report;
    Distances before, after;
    for (std::size_t s = 0; s < surfaces_.size(); ++s) {
      before.add(start_[s].distances);
      after.add(surfaces_[s].after);
      report.folded_before += start_[s].folded;
      report.folded_after += surfaces_[s].folded_after;
      report.surfaces += surfaces_[s].moved ? 1 : 0;
      report.held_back += surfaces_[s].held_back ? 1 : 0;
    }
    for (std::size_t c = 0; c < curves_.size() && association_.in_plane; ++c) {
      before.add(curves_at_start_[c]);
      after.add(curves_[c].after);
    }
    for (const Outcome& curve : curves_) {
      report.curves += curve.moved ? 1 : 0;
      report.held_back += curve.held_back ? 1 : 0;
    }
    for (std::size_t node = 0; node < mesh_.node_count(); ++node) {
      const auto at = static_cast<std::int32_t>(node);
      const double by = (place(mesh_.coordinates, at) - place(at_start_, at)).norm();
      report.nodes += by > 0 ? 1 : 0;
      report.farthest = std::max(report.farthest, by);
    }
    report.before = {before.largest, before.rms()};
    report.after = {after.largest, after.rms()};
    return report;
  }

  HighOrderMesh& mesh_;
  Association& association_;
  const std::vector<bool>& fixed_;
  const Team& team_;
  std::vector<double> at_start_;
  std::vector<NodeEntity> nodes_at_start_;
  std::vector<SurfaceNodes> surfaces_at_start_;
  std::vector<std::vector<EntityElement>> curve_elements_, surface_elements_;
  std::vector<Outcome> curves_, surfaces_;  ///< What they have come to so far.
  std::vector<Distances> curves_at_start_;  ///< By curve.
  std::vector<Start> start_;                ///< By surface.
};

}  // namespace

std::string SlideReport::sentence(double size) const {
  char text[768];
  const std::string held = held_back == 0 ? "" : " (on " + std::to_string(held_back) + " they were held back)";
  std::snprintf(text, sizeof text,
                "%lld boundary nodes slid on %d curves and %d surfaces%s, by at most %.3g (%.2g of the mesh's size); "
                "folded surface elements: %lld before, %lld after. Distance between the boundary and the geometry: rms "
                "%.3g before, %.3g after; largest %.3g before, %.3g after.",
                static_cast<long long>(nodes), curves, surfaces, held.c_str(), farthest, farthest / size,
                static_cast<long long>(folded_before), static_cast<long long>(folded_after), before.rms, after.rms,
                before.largest, after.largest);
  return text;
}

SlideReport slide(HighOrderMesh& mesh, Association& association, SlideOn what, const std::vector<bool>& fixed,
                  const Team& team) {
  const detail::PeriodicPairs pairs(mesh, association.size);
  if (!pairs.any()) return Sliding(mesh, association, fixed, team).run(what);
  const std::vector<double> coordinates = mesh.coordinates;
  const Association start = association;
  std::vector<bool> stays = fixed;
  while (true) {
    const SlideReport report = Sliding(mesh, association, stays, team).run(what);
    pairs.put_on_images(mesh, association, stays);
    if (!pairs.fix_broken(mesh.coordinates, stays)) return report;
    mesh.coordinates = coordinates;
    association = start;
  }
}

}  // namespace varimesh
