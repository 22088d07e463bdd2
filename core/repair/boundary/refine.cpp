#include "core/repair/boundary/refine.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/base/index.h"
#include "core/curve/parts.h"
#include "core/curve/refined.h"
#include "core/mesh/connectivity.h"
#include "core/repair/boundary/pinched_edges.h"
#include "core/repair/choose_splits.h"
#include "core/repair/split.h"
#include "core/repair/split_candidates.h"
#include "core/repair/split_rules.h"

namespace varimesh {
namespace {

using detail::MeshEdge;

/// Of the edges of a cell, those that turn by at least this part of what the one that turns most does are candidates.
constexpr double kNearlyMost = 0.7;
/// Edges that turn by less than this angle, in radians, hardly turn.
constexpr double kHardly = 0.05;
/// Two edges of a face leave no room between them if the sine of the angle is at most this (0.08: as for splits inside
/// the mesh, split_passes.cpp).
constexpr double kNoRoom = 0.08;

bool is_simplex(Shape shape) { return shape == Shape::Triangle || shape == Shape::Tetrahedron; }

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// The edges of a mesh, and which of them may be split.
class Edges {
 public:
  Edges(const HighOrderMesh& mesh, Association& association, const RefineRequest& request, const SplitRules& rules,
        const Cells& cells)
      : mesh_(mesh),
        association_(association),
        request_(request),
        rules_(rules),
        cells_(cells),
        parts_(mesh, association.surface_of_element),
        pinched_(pinched_edges(mesh, association, parts_, cells, rules)) {
    for (const PeriodicLink& link : mesh.periodic)
      for (const auto& [node, master] : link.nodes) linked_.insert({node, master});
    for (std::size_t e = 0; e < parts_.edges.size(); ++e)
      if (is_boundary(parts_.edges[e])) by_ends_.emplace(parts_.edges[e].ends, e);
  }

  /// The candidates among the edges of the cell that lie on the boundary.
  std::vector<SplitPlace> on_boundary(std::size_t cell) const {
    if (std::vector<SplitPlace> found = opposite_folds(cell); !found.empty()) return found;
    struct Rated {
      SplitPlace place;
      double turn, length;
    };
    std::vector<Rated> found;
    double most = 0, longest = 0;
    for (const SplitPlace& place : edges_of(cell)) {
      const auto edge = by_ends_.find({place[0], place[1]});
      if (edge == by_ends_.end() || !may_split(place, &parts_.edges[edge->second])) continue;
      found.push_back({place, turn(parts_.edges[edge->second]), length(place)});
      most = std::max(most, found.back().turn);
      longest = std::max(longest, found.back().length);
    }
    std::vector<SplitPlace> result;
    for (const Rated& edge : found)
      if (most > kHardly ? edge.turn >= kNearlyMost * most : edge.length == longest) result.push_back(edge.place);
    return result;
  }

  const std::map<SplitPlace, PinchedEdge>& pinched() const { return pinched_; }

  /// The longest edge of the cell that may be split.
  std::vector<SplitPlace> longest(std::size_t cell) const {
    std::optional<SplitPlace> best;
    for (const SplitPlace& place : edges_of(cell)) {
      const auto edge = by_ends_.find({place[0], place[1]});
      if (!may_split(place, edge == by_ends_.end() ? nullptr : &parts_.edges[edge->second])) continue;
      if (!best || length(place) > length(*best)) best = place;
    }
    return best ? std::vector{*best} : std::vector<SplitPlace>{};
  }

 private:
  /// The edges opposite the corners of boundary faces at which two edges on curves leave no room between them.
  std::vector<SplitPlace> opposite_folds(std::size_t cell) const {
    if (!is_simplex(cells_.shape(cell))) return {};
    const auto vertices = cells_.nodes(cell).first(at(reference::info(cells_.shape(cell)).vertices));
    std::vector<SplitPlace> result;
    for (const std::int32_t v : vertices)
      for (const std::int32_t a : vertices)
        for (const std::int32_t b : vertices) {
          if (a >= b || v == a || v == b) continue;
          if (mesh_.dimension == 3 && !rules_.is_boundary(face_place(v, a, b))) continue;
          const std::optional<Eigen::Vector3d> to_a = along_curve(v, a), to_b = along_curve(v, b);
          if (!to_a || !to_b) continue;
          const Eigen::Vector3d normal = (x(a) - x(v)).cross(x(b) - x(v)).normalized();
          const auto edge = by_ends_.find({a, b});
          if (to_a->cross(*to_b).dot(normal) <= kNoRoom &&
              may_split(edge_place(a, b), edge == by_ends_.end() ? nullptr : &parts_.edges[edge->second]))
            result.push_back(edge_place(a, b));
        }
    return result;
  }

  /// The unit tangent at `from` of the edge to `to`; nothing if the edge does not lie on a curve.
  std::optional<Eigen::Vector3d> along_curve(std::int32_t from, std::int32_t to) const {
    const auto found = by_ends_.find({std::min(from, to), std::max(from, to)});
    if (found == by_ends_.end() || pinched_.contains(edge_place(from, to))) return std::nullopt;
    std::vector<std::int32_t> inner = parts_.edges[found->second].inner;
    if (inner.empty() || association_.nodes[at(inner.front())].dimension != 1) return std::nullopt;
    if (from > to) std::ranges::reverse(inner);
    // The derivative at 0 of the polynomial through values at 0, 1, … P: the sum of −(−1)^i C(P, i) / i (f_i − f_0).
    inner.push_back(to);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double binomial = 1;
    for (std::size_t i = 1; i <= inner.size(); ++i) {
      binomial *= static_cast<double>(inner.size() + 1 - i) / static_cast<double>(i);
      sum += (i % 2 == 1 ? binomial : -binomial) / static_cast<double>(i) * (x(inner[i - 1]) - x(from));
    }
    return sum.normalized();
  }

  /// In a plane every edge lies on a surface; those of one element are on the boundary.
  bool is_boundary(const MeshEdge& edge) const {
    return !edge.surfaces.empty() && (!association_.in_plane || edge.elements == 1);
  }

  std::vector<SplitPlace> edges_of(std::size_t cell) const {
    const int vertices = reference::info(cells_.shape(cell)).vertices;
    if (!is_simplex(cells_.shape(cell))) return {};
    const auto nodes = cells_.nodes(cell);
    std::vector<SplitPlace> result;
    for (int a = 0; a < vertices; ++a)
      for (int b = 0; b < a; ++b) result.push_back(edge_place(nodes[at(a)], nodes[at(b)]));
    return result;
  }

  bool may_split(const SplitPlace& place, const MeshEdge* boundary) const {
    if (boundary != nullptr) {
      if (boundary->surfaces.front() < 0 || boundary->inner.empty()) return false;
      for (const std::int32_t node : boundary->inner)
        if ((association_.nodes[at(node)].dimension < 0 && !pinched_.contains(place)) ||
            (!request_.held.empty() && request_.held[at(node)]))
          return false;
    }
    if (linked_.contains(place[0]) && linked_.contains(place[1])) return false;
    return std::ranges::all_of(rules_.cells_around(place),
                               [&](std::int32_t cell) { return is_simplex(cells_.shape(at(cell))); });
  }

  Eigen::Vector3d x(std::int32_t node) const {
    return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * at(node)]);
  }
  double length(const SplitPlace& place) const { return (x(place[0]) - x(place[1])).norm(); }

  /// The largest angle between two normals of a surface, or two tangents of a curve, at nodes of the edge.
  double turn(const MeshEdge& edge) const {
    std::vector<std::int32_t> nodes(edge.ends.begin(), edge.ends.end());
    nodes.insert(nodes.end(), edge.inner.begin(), edge.inner.end());
    double most = 0;
    std::vector<Eigen::Vector3d> directions;
    const auto rate = [&] {
      for (std::size_t i = 0; i < directions.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) most = std::max(most, angle(directions[i], directions[j]));
      directions.clear();
    };
    for (const int s : edge.surfaces) {
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[at(s)].shape;
      for (const std::int32_t node : nodes) {
        const auto [u, v] = association_.surfaces[at(s)].of(node);
        const Eigen::Vector3d normal = shape.normal(shape.at(u, v), u, v);
        if (normal.allFinite() && normal.squaredNorm() > 0) directions.push_back(normal);
      }
      rate();
    }
    const NodeEntity& inside = association_.nodes[at(edge.inner.front())];
    if (inside.dimension != 1) return most;
    for (const std::int32_t node : nodes) {
      const NodeEntity& entity = association_.nodes[at(node)];
      if (entity.dimension != 1 || entity.entity != inside.entity) continue;
      const Eigen::Vector3d along = association_.geometry.curves[at(inside.entity)].shape->at(entity.at[0]).dt;
      if (along.allFinite() && along.squaredNorm() > 0) directions.push_back(along);
    }
    rate();
    return most;
  }

  const HighOrderMesh& mesh_;
  Association& association_;
  const RefineRequest& request_;
  const SplitRules& rules_;
  const Cells& cells_;
  const detail::MeshParts parts_;
  const std::map<SplitPlace, PinchedEdge> pinched_;
  std::map<std::array<std::int32_t, 2>, std::size_t> by_ends_;  // those on the boundary
  std::set<std::int32_t> linked_;                               // nodes of periodic links
};

/// Edges to split.
struct Places {
  std::size_t edges = 0;
  std::vector<SplitPlace> places;                 ///< A pinched edge comes once for each of its sides.
  std::vector<std::vector<std::int32_t>> beside;  ///< As split() takes it.
};

/// Puts each pinched edge there twice, once for each of its sides, and gives the sides nodes of their own.
Places by_sides(HighOrderMesh& mesh, std::span<const SplitPlace> places,
                const std::map<SplitPlace, PinchedEdge>& pinched) {
  Places result;
  result.edges = places.size();
  part_nodes(mesh, places, pinched);
  for (const SplitPlace& place : places) {
    const auto found = pinched.find(place);
    if (found == pinched.end()) {
      result.places.push_back(place);
      result.beside.emplace_back();
      continue;
    }
    for (const PinchedEdge::Side& side : found->second.sides) {
      result.places.push_back(place);
      result.beside.push_back(side.beside);
    }
  }
  return result;
}

/// The edges to split, as far as the mesh may grow.
/// @param mesh     pinched edges among them get nodes of their own for each side
/// @param is_full  receives whether it may not grow as far as wanted
Places edges_to_split(HighOrderMesh& mesh, Association& association, const RefineRequest& request, bool& is_full) {
  const Cells cells(mesh, mesh.dimension);
  const std::vector<bool> none(mesh.node_count(), false);
  const SplitRules rules(mesh, cells, none);
  const Edges edges(mesh, association, request, rules, cells);
  std::vector<WeakGroup> groups;
  const auto look = [&](auto candidates) {
    for (std::size_t c = 0; c < cells.count(); ++c) {
      if (!std::ranges::binary_search(request.wanted, cells.number(c))) continue;
      WeakGroup group;
      group.cells = {static_cast<std::int32_t>(c)};
      group.candidates = (edges.*candidates)(c);
      if (!group.candidates.empty()) groups.push_back(std::move(group));
    }
  };
  look(&Edges::on_boundary);
  if (groups.empty()) look(&Edges::longest);
  std::vector<SplitPlace> places = choose_splits(groups, rules);
  std::size_t count = cells.count();
  std::erase_if(places, [&](const SplitPlace& place) {
    const std::size_t more = rules.cells_around(place).size();
    if (count + more > request.most_cells) return is_full = true;
    count += more;
    return false;
  });
  return by_sides(mesh, places, edges.pinched());
}

/// The names of the surfaces of the geometry on which new vertices lie.
std::set<std::string> surfaces_around(const HighOrderMesh& mesh, const Association& association,
                                      std::span<const NewVertex> vertices) {
  std::vector<bool> is_new(mesh.node_count(), false);
  for (const NewVertex& vertex : vertices) is_new[at(vertex.node)] = true;
  std::set<std::string> names;
  for (std::size_t s = 0; s < association.surfaces.size() && !association.in_plane; ++s)
    if (std::ranges::any_of(association.surfaces[s].nodes, [&](std::int32_t node) { return is_new[at(node)]; }))
      names.insert(association.geometry.surfaces[s].number_text());
  return names;
}

}  // namespace

RefineReport refine(HighOrderMesh& mesh, Association& association, const RefineRequest& request,
                    std::vector<RepairStep>& steps, const Team& team) {
  RefineReport report;
  const std::size_t had = mesh.node_count(), done = steps.size();
  const auto [edges, places, beside] = edges_to_split(mesh, association, request, report.is_full);
  if (places.empty()) return report;
  SplitParents parents;
  mesh = split(mesh, places, steps, &parents, beside);
  std::vector<std::vector<int>> surface_of_element = association.surface_of_element;
  for (std::size_t b = 0; b < parents.size(); ++b)
    if (!surface_of_element[b].empty())
      for (const std::size_t parent : parents[b]) surface_of_element[b].push_back(surface_of_element[b][parent]);
  std::map<std::int64_t, std::int32_t> index;
  for (std::size_t n = had; n < mesh.node_count(); ++n) index[mesh.node_numbers[n]] = static_cast<std::int32_t>(n);
  std::vector<NewVertex> vertices;
  for (std::size_t i = 0; i < places.size(); ++i)
    vertices.push_back({index.at(steps[done + i].node), {places[i][0], places[i][1]}});
  place_refined(mesh, association, std::move(surface_of_element), vertices, team);
  report.edges = edges;
  report.surfaces = surfaces_around(mesh, association, vertices);
  return report;
}

}  // namespace varimesh
