#include "core/association/smooth_joints.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>

#include "core/association/curve_chains.h"
#include "core/geometry/joined.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

using detail::CurveChain;
using geometry::SurfaceShape;

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

/// An edge of the mesh on a curve, as an element beside it sees it.
struct Side {
  int surface = -1;
  std::vector<std::int32_t> nodes;
  Eigen::Vector3d inward = Eigen::Vector3d::Zero();  ///< From the edge into the element, perpendicular to the edge.
};

class Joining {
 public:
  Joining(const HighOrderMesh& mesh, Association& association, double angle)
      : mesh_(mesh), association_(association), geometry_(association.geometry), cosine_(std::cos(angle)) {
    part_of_.assign(geometry_.surfaces.size(), {-1, 0});
    signs_.assign(geometry_.surfaces.size(), 1);
    is_joint_.assign(geometry_.curves.size(), false);
  }

  SmoothJoints run() {
    collect_sides();
    collect_groups();
    for (std::size_t c = 0; c < geometry_.curves.size(); ++c)
      if (const double sign = sign_of_joint(static_cast<int>(c)); sign != 0)
        joints_.push_back({static_cast<int>(c), sign});
    join_surfaces();
    if (result_.joined_surfaces > 0) rewrite_surfaces();
    join_curves();
    return result_;
  }

 private:
  struct Joint {
    int curve;
    double sign;  ///< −1: the normals of its surfaces point to opposite sides.
  };

  Eigen::Vector3d position(std::int32_t node) const {
    return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * index(node)]);
  }

  // ===== Which curves are joints =====

  void collect_sides() {
    sides_.resize(geometry_.curves.size());
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      const std::vector<int>& surfaces = association_.surface_of_element[b];
      const auto stride = index(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < surfaces.size(); ++e)
        if (surfaces[e] >= 0) collect_sides(block, &block.nodes[e * stride], surfaces[e]);
    }
  }

  void collect_sides(const ElementBlock& block, const std::int32_t* nodes, int surface) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int v = 0; v < info.vertices; ++v) middle += position(nodes[v]) / info.vertices;
    for (int facet = 0; facet < static_cast<int>(info.facets.size()); ++facet) {
      Side side{surface, {}, {}};
      for (const int local : reference::facet_nodes(block.shape, block.order, facet))
        side.nodes.push_back(nodes[local]);
      const NodeEntity& inner = association_.nodes[index(side.nodes[2])];
      if (inner.dimension != 1) continue;
      const Eigen::Vector3d along = (position(side.nodes[1]) - position(side.nodes[0])).normalized();
      side.inward = middle - position(side.nodes[0]);
      side.inward -= along * along.dot(side.inward);
      sides_[index(inner.entity)].push_back(std::move(side));
    }
  }

  /// By surface: the physical groups of its elements.
  void collect_groups() {
    groups_.resize(geometry_.surfaces.size());
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      std::vector<int> physical = mesh_.blocks[b].physical;
      std::ranges::sort(physical);
      std::vector<int> surfaces = association_.surface_of_element[b];
      std::ranges::sort(surfaces);
      const auto repeated = std::ranges::unique(surfaces);
      surfaces.erase(repeated.begin(), repeated.end());
      for (const int surface : surfaces)
        if (surface >= 0) groups_[index(surface)].push_back(physical);
    }
    for (auto& of : groups_) {
      std::ranges::sort(of);
      const auto repeated = std::ranges::unique(of);
      of.erase(repeated.begin(), repeated.end());
    }
  }

  /// The normal of a surface at one of its nodes; zero at a pole.
  Eigen::Vector3d normal(int surface, std::int32_t node) {
    const std::array<double, 2> at = association_.surfaces[index(surface)].of(node);
    const SurfaceShape& shape = *geometry_.surfaces[index(surface)].shape;
    return shape.normal(shape.at(at[0], at[1]), at[0], at[1]);
  }

  /// 1 or −1 if the curve is a smooth joint of two surfaces, whose normals agree or are opposite; otherwise 0.
  double sign_of_joint(int c) {
    const std::vector<int>& around = geometry_.curves[index(c)].surfaces;
    if (around.size() != 2 || around[0] == around[1] || groups_[index(around[0])] != groups_[index(around[1])])
      return 0;
    std::map<std::pair<std::int32_t, std::int32_t>, std::vector<const Side*>> edges;
    for (const Side& side : sides_[index(c)]) edges[std::minmax(side.nodes[0], side.nodes[1])].push_back(&side);
    double sign = 0;
    for (const auto& [ends, sides] : edges) {
      if (sides.size() != 2 || sides[0]->surface == sides[1]->surface) return 0;
      if (!(sides[0]->inward.dot(sides[1]->inward) < 0)) return 0;
      for (const std::int32_t node : sides[0]->nodes) {
        const double agreement = normal(sides[0]->surface, node).dot(normal(sides[1]->surface, node));
        if (!(std::abs(agreement) >= cosine_) || agreement * sign < 0) return 0;
        sign = agreement > 0 ? 1 : -1;
      }
    }
    return sign;
  }

  // ===== Surfaces =====

  /// Finds the surfaces that hang together by joints. A joint at which the normals cannot be made to agree is none.
  void join_surfaces() {
    std::vector<std::vector<std::pair<int, Joint>>> around(geometry_.surfaces.size());
    for (const Joint& joint : joints_) {
      const std::vector<int>& surfaces = geometry_.curves[index(joint.curve)].surfaces;
      around[index(surfaces[0])].emplace_back(surfaces[1], joint);
      around[index(surfaces[1])].emplace_back(surfaces[0], joint);
    }
    for (std::size_t s = 0; s < geometry_.surfaces.size(); ++s) {
      if (around[s].empty() || part_of_[s].first >= 0) continue;
      const auto first = static_cast<int>(s);
      std::vector<int>& members = members_[first];
      part_of_[s] = {first, 0};
      members.push_back(first);
      for (std::size_t k = 0; k < members.size(); ++k)
        for (const auto& [next, joint] : around[index(members[k])]) {
          if (part_of_[index(next)].first >= 0) continue;
          part_of_[index(next)] = {first, members.size()};
          signs_[index(next)] = signs_[index(members[k])] * joint.sign;
          members.push_back(next);
        }
      result_.joined_surfaces += static_cast<int>(members.size()) - 1;
    }
    for (const Joint& joint : joints_) {
      const std::vector<int>& surfaces = geometry_.curves[index(joint.curve)].surfaces;
      is_joint_[index(joint.curve)] = signs_[index(surfaces[0])] * joint.sign == signs_[index(surfaces[1])];
      result_.free_curves += is_joint_[index(joint.curve)] ? 1 : 0;
    }
  }

  /// The surface that a surface is part of, or itself.
  int whole(int surface) const {
    return part_of_[index(surface)].first >= 0 ? part_of_[index(surface)].first : surface;
  }
  std::array<double, 2> on_whole(int surface, const std::array<double, 2>& at) const {
    if (part_of_[index(surface)].first < 0) return at;
    return geometry::parameters_on_joined(*shapes_[index(surface)], part_of_[index(surface)].second, at);
  }

  void rewrite_surfaces() {
    for (const geometry::Surface& surface : geometry_.surfaces) shapes_.push_back(surface.shape);
    for (NodeEntity& entity : association_.nodes)
      if (entity.dimension == 2) {
        entity.at = on_whole(entity.entity, entity.at);
        entity.entity = whole(entity.entity);
      }
    for (const auto& [first, members] : members_) {
      std::vector<geometry::SurfacePart> parts;
      std::map<std::int32_t, std::array<double, 2>> nodes;
      std::vector<int> curves;
      for (const int s : members) {
        parts.push_back({shapes_[index(s)], signs_[index(s)], {}});
        SurfaceNodes& own = association_.surfaces[index(s)];
        for (std::size_t i = 0; i < own.nodes.size(); ++i)
          nodes.try_emplace(own.nodes[i], on_whole(s, own.parameters[i]));
        own = {};
        for (const int c : geometry_.surfaces[index(s)].curves) {
          if (!is_joint_[index(c)]) curves.push_back(c);
          if (!is_joint_[index(c)]) continue;
          for (const int other : geometry_.curves[index(c)].surfaces)
            if (other != s) parts.back().neighbours.push_back(part_of_[index(other)].second);
        }
      }
      for (const auto& [node, at] : nodes) {
        association_.surfaces[index(first)].nodes.push_back(node);
        association_.surfaces[index(first)].parameters.push_back(at);
      }
      geometry_.surfaces[index(first)].shape = geometry::join(std::move(parts));
      std::ranges::sort(curves);
      const auto repeated = std::ranges::unique(curves);
      curves.erase(repeated.begin(), repeated.end());
      geometry_.surfaces[index(first)].curves = std::move(curves);
    }
    for (std::vector<int>& of_block : association_.surface_of_element)
      for (int& surface : of_block)
        if (surface >= 0) surface = whole(surface);
    put_joints_on_surfaces();
    for (geometry::Curve& curve : geometry_.curves)
      for (int& surface : curve.surfaces) surface = whole(surface);
  }

  void put_joints_on_surfaces() {
    for (std::size_t node = 0; node < association_.nodes.size(); ++node) {
      NodeEntity& entity = association_.nodes[node];
      if (entity.dimension == 1 && is_joint_[index(entity.entity)])
        put_on_surface(static_cast<std::int32_t>(node), whole(geometry_.curves[index(entity.entity)].surfaces[0]));
    }
  }

  void put_on_surface(std::int32_t node, int surface) {
    NodeEntity& entity = association_.nodes[index(node)];
    entity = {2, surface, entity.distance, association_.surfaces[index(surface)].of(node)};
  }

  // ===== Curves and vertices =====

  void join_curves() {
    const auto is_seam = [&](const geometry::Curve& curve) {
      if (curve.surfaces.size() != 2 || curve.surfaces[0] != curve.surfaces[1]) return false;
      const SurfaceShape& shape = *geometry_.surfaces[index(curve.surfaces[0])].shape;
      return shape.u_range().period > 0 || shape.v_range().period > 0;
    };
    std::vector<bool> counts;
    for (std::size_t c = 0; c < geometry_.curves.size(); ++c)
      counts.push_back(!is_joint_[c] && !is_seam(geometry_.curves[c]));
    const detail::SmoothVertices smooth = detail::smooth_vertices(geometry_, counts, cosine_);
    std::map<std::int32_t, std::int32_t> node_of;  // by vertex
    for (std::size_t node = 0; node < association_.nodes.size(); ++node)
      if (association_.nodes[node].dimension == 0)
        node_of[association_.nodes[node].entity] = static_cast<std::int32_t>(node);
    for (const int vertex : smooth.without_curves)
      if (const auto node = node_of.find(vertex); node != node_of.end()) free_on_surface(vertex, node->second);
    for (const CurveChain& chain : smooth.chains) rewrite_chain(chain, node_of);
  }

  /// Frees the node of a vertex at which only joints end, if all of them are inside one surface that has no pole there.
  void free_on_surface(int vertex, std::int32_t node) {
    std::optional<int> surface;
    for (std::size_t c = 0; c < geometry_.curves.size(); ++c) {
      const geometry::Curve& curve = geometry_.curves[c];
      if (std::ranges::find(curve.vertices, vertex) == curve.vertices.end()) continue;
      if (!is_joint_[c] || (surface && *surface != curve.surfaces[0])) return;
      surface = curve.surfaces[0];
    }
    if (!surface || normal(*surface, node) == Eigen::Vector3d::Zero()) return;
    put_on_surface(node, *surface);
    ++result_.free_vertices;
  }

  void rewrite_chain(const CurveChain& chain, const std::map<std::int32_t, std::int32_t>& node_of) {
    // A closed curve by itself is periodic already, but for a vertex that holds a node.
    if (chain.links.size() == 1 && !node_of.contains(chain.links[0].vertex_after)) return;
    std::vector<geometry::CurvePart> parts;
    for (const CurveChain::Link& link : chain.links)
      parts.push_back({geometry_.curves[index(link.curve)].shape, link.backwards});
    const auto joined = std::make_shared<geometry::JoinedCurve>(std::move(parts), chain.closed);
    const int first = chain.links.front().curve;
    std::map<int, std::size_t> place;
    for (std::size_t k = 0; k < chain.links.size(); ++k) place[chain.links[k].curve] = k;
    for (NodeEntity& entity : association_.nodes) {
      if (entity.dimension != 1) continue;
      const auto at = place.find(entity.entity);
      if (at != place.end()) entity = {1, first, entity.distance, {joined->parameter(at->second, entity.at[0]), 0}};
    }
    for (std::size_t k = 0; k < chain.links.size(); ++k) {
      const int vertex = chain.links[k].vertex_after;
      const auto node = node_of.find(vertex);
      if (vertex < 0 || node == node_of.end()) continue;
      const geometry::Range range = geometry_.curves[index(chain.links[k].curve)].shape->range();
      const double end = chain.links[k].backwards ? range.first : range.last;
      NodeEntity& entity = association_.nodes[index(node->second)];
      entity = {1, first, entity.distance, {joined->parameter(k, end), 0}};
      ++result_.free_vertices;
    }
    result_.joined_curves += static_cast<int>(chain.links.size()) - 1;
    geometry_.curves[index(first)].shape = joined;
    geometry_.curves[index(first)].vertices = chain.ends;
    for (geometry::Surface& surface : geometry_.surfaces) {
      std::erase_if(surface.curves, [&](int c) { return c != first && place.contains(c); });
    }
  }

  const HighOrderMesh& mesh_;
  Association& association_;
  geometry::Geometry& geometry_;
  double cosine_;
  SmoothJoints result_;
  std::vector<std::vector<Side>> sides_;               ///< By curve.
  std::vector<std::vector<std::vector<int>>> groups_;  ///< By surface.
  std::vector<Joint> joints_;
  std::vector<bool> is_joint_;                        ///< By curve.
  std::map<int, std::vector<int>> members_;           ///< Of a joined surface's first part: all its parts.
  std::vector<std::pair<int, std::size_t>> part_of_;  ///< By surface: the first part, or −1, and which part it is.
  std::vector<double> signs_;                         ///< By surface.
  std::vector<std::shared_ptr<const SurfaceShape>> shapes_;  ///< By surface: as it came.
};

}  // namespace

std::string SmoothJoints::sentence() const {
  char text[256];
  std::snprintf(text, sizeof text,
                "Smooth joints: %d surfaces and %d curves became part of others; nodes may cross %d curves and %d "
                "vertices.",
                joined_surfaces, joined_curves, free_curves, free_vertices);
  return text;
}

SmoothJoints join_smoothly(const HighOrderMesh& mesh, Association& association, double angle) {
  return Joining(mesh, association, angle).run();
}

}  // namespace varimesh
