#include "core/slide/slide.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "core/geometry/closest_point.h"
#include "core/slide/between_nodes.h"
#include "core/slide/entity_newton.h"

namespace varimesh {
namespace {

using detail::Distances;
using detail::EntityElement;
using detail::EntityNode;
using detail::EntitySlide;

constexpr int kMostIterations = 60;
/// How much of the way to its optimum an entity's nodes may go.
constexpr double kParts[] = {1, 0.5, 0.25, 0.125};
/// Distances that differ by less than this, relative to the mesh's size, are equal: rounding.
constexpr double kRounding = 1e-12;

Eigen::Map<Eigen::Vector3d> place(std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<Eigen::Vector3d>(&coordinates[3 * static_cast<std::size_t>(node)]);
}

/// What one entity came to.
struct Outcome {
  Distances before, after;
  std::int64_t folded_before = 0, folded_after = 0;
  bool moved = false, held_back = false;
  std::vector<EntityNode> nodes;
};

class Sliding {
 public:
  Sliding(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed, const Team& team)
      : mesh_(mesh), association_(association), fixed_(fixed), team_(team), at_start_(mesh.coordinates) {}

  SlideReport run(SlideOn what) {
    const auto curves = detail::curve_elements(mesh_, association_);
    const auto surfaces = detail::surface_elements(mesh_, association_);
    if (what == SlideOn::All) slide_curves(curves);
    slide_surfaces(surfaces, what != SlideOn::None);
    for (std::size_t node = 0; node < mesh_.node_count(); ++node) {
      const auto index = static_cast<std::int32_t>(node);
      const double by = (place(mesh_.coordinates, index) - place(at_start_, index)).norm();
      report_.nodes += by > 0 ? 1 : 0;
      report_.farthest = std::max(report_.farthest, by);
    }
    report_.before = {before_.largest, before_.rms()};
    report_.after = {after_.largest, after_.rms()};
    return report_;
  }

 private:
  void slide_curves(const std::vector<std::vector<EntityElement>>& elements) {
    std::vector<Outcome> outcomes(elements.size());
    team_.for_each(static_cast<std::int32_t>(elements.size()), 1, [&](std::int32_t c) {
      const auto& own = elements[index(c)];
      if (own.empty()) return;
      const geometry::CurveShape& shape = *association_.geometry.curves[index(c)].shape;
      outcomes[index(c)] = choose(
          detail::curve_nodes(c, own, association_, mesh_.coordinates, fixed_),
          [&](const std::vector<EntityNode>& nodes, int iterations) {
            return detail::slide_on_curve(c, own, mesh_.order, association_, at_start_, nodes, iterations);
          },
          [&](const EntityNode& node) { return shape.at(node.at[0]).x; }, [](const EntityNode&) { return true; },
          [&](const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
            return detail::curve_distances(shape, own, mesh_.order, nodes, coordinates);
          });
    });
    for (const Outcome& outcome : outcomes) {
      take(outcome);
      report_.curves += outcome.moved ? 1 : 0;
    }
    follow_curves();
  }

  void take(const Outcome& outcome) {
    report_.held_back += outcome.held_back ? 1 : 0;
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
      SurfaceNodes& own = association_.surfaces[static_cast<std::size_t>(s)];
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[static_cast<std::size_t>(s)].shape;
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

  void slide_surfaces(const std::vector<std::vector<EntityElement>>& elements, bool moves) {
    std::vector<Outcome> outcomes(elements.size());
    const std::vector<bool> all(mesh_.node_count(), true);
    team_.for_each(static_cast<std::int32_t>(elements.size()), 1, [&](std::int32_t s) {
      const auto& own = elements[index(s)];
      if (own.empty()) return;
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[index(s)].shape;
      outcomes[index(s)] = choose(
          detail::surface_nodes(s, association_, mesh_.coordinates, moves ? fixed_ : all),
          [&](const std::vector<EntityNode>& nodes, int iterations) {
            return detail::slide_on_surface(s, own, mesh_.order, association_, at_start_, nodes, iterations);
          },
          [&](const EntityNode& node) { return shape.at(node.at[0], node.at[1]).x; },
          [&](const EntityNode& node) { return shape.contains(node.at[0], node.at[1]); },
          [&](const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
            return detail::surface_distances(shape, own, mesh_.order, nodes, coordinates);
          });
    });
    for (std::size_t s = 0; s < outcomes.size(); ++s) {
      const Outcome& outcome = outcomes[s];
      take(outcome);
      if (outcome.moved)
        for (const EntityNode& node : outcome.nodes)
          if (node.free) association_.surfaces[s].of(node.node) = node.at;
      before_.add(outcome.before);
      after_.add(outcome.after);
      report_.folded_before += outcome.folded_before;
      report_.folded_after += outcome.folded_after;
      report_.surfaces += outcome.moved ? 1 : 0;
    }
  }

  /// Slides the nodes of one entity, and takes the largest part of the way on which the number of folded elements and
  /// the distances do not rise and no node leaves the entity.
  template <class Slide, class Point, class Inside, class Measure>
  Outcome choose(const std::vector<EntityNode>& start, const Slide& slide_nodes, const Point& point,
                 const Inside& inside, const Measure& measure) {
    const EntitySlide slide = slide_nodes(start, kMostIterations);
    Outcome outcome;
    outcome.folded_before = outcome.folded_after = slide.folded_before;
    outcome.before = measure(start, at_start_);
    outcome.after = measure(start, mesh_.coordinates);
    outcome.nodes = start;
    if (slide.iterations == 0) return outcome;
    std::vector<double> coordinates = mesh_.coordinates;
    const double rounding = kRounding * association_.size;
    for (const double part : kParts) {
      std::vector<EntityNode> nodes = start;
      bool moves = false;
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (!nodes[i].free || slide.nodes[i].at == start[i].at) continue;  // nodes at poles stay as they are, too
        moves = true;
        for (std::size_t k = 0; k < 2; ++k) nodes[i].at[k] += part * (slide.nodes[i].at[k] - start[i].at[k]);
        nodes[i].x = part == 1 ? slide.nodes[i].x : point(nodes[i]);
        place(coordinates, nodes[i].node) = nodes[i].x;
      }
      if (!moves) return outcome;
      if (leaves(start, nodes, inside)) continue;
      const Distances after = measure(nodes, coordinates);
      if (after.largest > outcome.before.largest + rounding || after.rms() > outcome.before.rms() + rounding) continue;
      const std::int64_t folded = part == 1 ? slide.folded_after : slide_nodes(nodes, 0).folded_before;
      if (folded > outcome.folded_before) continue;
      outcome.after = after;
      outcome.nodes = std::move(nodes);
      outcome.moved = true;
      outcome.held_back = part < 1;
      outcome.folded_after = folded;
      return outcome;
    }
    outcome.held_back = true;
    return outcome;
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

  HighOrderMesh& mesh_;
  Association& association_;
  const std::vector<bool>& fixed_;
  const Team& team_;
  std::vector<double> at_start_;
  Distances before_, after_;
  SlideReport report_;
};

}  // namespace

Expected<SlideOn> slide_on_from_name(std::string_view name) {
  if (name == "none") return SlideOn::None;
  if (name == "surfaces") return SlideOn::Surfaces;
  if (name == "all") return SlideOn::All;
  return bad_option("--slide must be none, surfaces or all, not '" + std::string(name) + "'.");
}

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
  return Sliding(mesh, association, fixed, team).run(what);
}

}  // namespace varimesh
