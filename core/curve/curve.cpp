#include "core/curve/curve.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/curve/blend.h"
#include "core/curve/carry_over.h"
#include "core/curve/layers.h"
#include "core/curve/parts.h"
#include "core/curve/place.h"
#include "core/curve/straight.h"
#include "core/mesh/changes/change_order.h"

namespace varimesh {
namespace {

using detail::MeshEdge;
using detail::MeshFace;
using detail::MeshParts;

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

class Curving {
 public:
  Curving(const HighOrderMesh& linear, const Association& start, HighOrderMesh raised, const Team& team)
      : linear_(linear), start_(start), team_(team) {
    result_.mesh = std::move(raised);
    straight_ = result_.mesh.coordinates;
  }

  CurvedMesh run() {
    carry_over();
    const MeshParts parts(result_.mesh, start_.surface_of_element);
    detail::BoundaryPlacing(result_.mesh, result_.association, parts, team_).run();
    std::vector<bool> moved = follow_layers(parts);
    blend_the_rest(parts, moved);
    count(parts, moved);
    return std::move(result_);
  }

 private:
  HighOrderMesh& mesh() { return result_.mesh; }

  void carry_over() {
    std::vector<std::int32_t> before(mesh().node_count(), -1);
    for (std::size_t b = 0; b < mesh().blocks.size(); ++b) {
      const ElementBlock& old = linear_.blocks[b];
      const ElementBlock& made = mesh().blocks[b];
      const auto vertices = index(reference::info(old.shape).vertices);
      const auto stride = made.nodes.size() / std::max<std::size_t>(made.size(), 1);
      for (std::size_t e = 0; e < made.size(); ++e)
        for (std::size_t k = 0; k < vertices; ++k)
          before[index(made.nodes[e * stride + k])] = old.nodes[e * vertices + k];
    }
    result_.association = detail::carry_over(start_, mesh(), start_.surface_of_element, before);
  }

  double shift(std::int32_t node) const {
    double most = 0;
    for (std::size_t c = 3 * index(node); c < 3 * index(node) + 3; ++c)
      most = std::max(most, std::abs(result_.mesh.coordinates[c] - straight_[c]));
    return most;
  }

  /// Edges and faces inside thin elements. Returns by node whether it was moved.
  std::vector<bool> follow_layers(const MeshParts& parts) {
    std::vector<bool> on_surface(mesh().node_count(), false);
    for (const MeshFace& face : parts.faces)
      if (face.on_surface)
        for (const std::int32_t node : face.nodes) on_surface[index(node)] = true;
    std::vector<bool> moved = detail::move_faces_of_layers(mesh(), on_surface, straight_, mesh().coordinates);
    std::vector<std::int32_t> start;
    for (std::size_t e = 0; e < parts.edges.size(); ++e) {
      const MeshEdge& edge = parts.edges[e];
      if (!edge.surfaces.empty() && std::ranges::any_of(edge.inner, [&](auto node) { return shift(node) > 0; }))
        start.push_back(static_cast<std::int32_t>(e));
    }
    detail::walk_edges(
        parts, mesh().order, start, straight_, false, [](const MeshFace& face) { return !face.on_surface; },
        [&](std::int32_t edge) { return parts.edges[index(edge)].surfaces.empty(); },
        [&](const detail::EdgeStep& step) {
          for (std::size_t i = 0; i < step.nodes_to.size(); ++i) {
            moved[index(step.nodes_to[i])] = true;
            for (std::size_t c = 0; c < 3; ++c) {
              const std::size_t a = 3 * index(step.nodes_from[i]) + c, b = 3 * index(step.nodes_to[i]) + c;
              mesh().coordinates[b] = straight_[b] + (mesh().coordinates[a] - straight_[a]);
            }
          }
        });
    return moved;
  }

  void blend_the_rest(const MeshParts& parts, const std::vector<bool>& moved) {
    team_.for_each(static_cast<std::int32_t>(parts.faces.size()), 64, [&](std::int32_t f) {
      const MeshFace& face = parts.faces[index(f)];
      const detail::InnerBlend& inside = detail::inner_blend(face.shape, mesh().order);
      if (face.on_surface || inside.inner.empty() || moved[index(face.nodes[index(inside.inner[0])])]) return;
      detail::move_inner(inside, face.nodes.data(), straight_, mesh().coordinates);
    });
    for (const ElementBlock& block : mesh().blocks) {
      if (reference::info(block.shape).dimension != 3) continue;
      const detail::InnerBlend& inside = detail::inner_blend(block.shape, mesh().order);
      const auto stride = index(reference::node_count(block.shape, mesh().order));
      team_.for_each(static_cast<std::int32_t>(block.size()), 64, [&](std::int32_t e) {
        detail::move_inner(inside, &block.nodes[index(e) * stride], straight_, mesh().coordinates);
      });
    }
  }

  /// By node: whether it lies inside an edge or a face, and so was added to the linear mesh.
  std::vector<bool> new_nodes(const MeshParts& parts) {
    std::vector<bool> is_new(mesh().node_count(), false);
    for (const MeshEdge& edge : parts.edges)
      for (const std::int32_t node : edge.inner) is_new[index(node)] = true;
    for (const MeshFace& face : parts.faces)
      for (const int local : detail::inner_blend(face.shape, mesh().order).inner)
        is_new[index(face.nodes[index(local)])] = true;
    return is_new;
  }

  void count(const MeshParts& parts, const std::vector<bool>& moved) {
    CurveReport& report = result_.report;
    report.in_layers = std::ranges::count(moved, true);
    std::set<int> held_tags;
    std::map<int, std::string> outside;
    std::set<std::int32_t> held;
    const std::vector<bool> is_new = new_nodes(parts);
    for (std::size_t b = 0; b < mesh().blocks.size(); ++b) {
      const ElementBlock& block = mesh().blocks[b];
      if (reference::info(block.shape).dimension != 2) continue;
      for (const std::int32_t node : block.nodes) {
        if (result_.association.nodes[index(node)].dimension >= 0) continue;
        if (held.insert(node).second && is_new[index(node)]) ++report.held;
        if (is_new[index(node)]) held_tags.insert(block.entity);
      }
    }
    result_.association.held.assign(held.begin(), held.end());
    report.held_tags.assign(held_tags.begin(), held_tags.end());
    report.straight = detail::count_straight_elements(mesh(), result_.association);
    for (std::size_t node = 0; node < is_new.size(); ++node) {
      const NodeEntity& entity = result_.association.nodes[node];
      if (!is_new[node] || entity.dimension < 1) continue;
      ++(entity.dimension == 1 ? report.on_curves : report.on_surfaces);
      if (entity.dimension == 1) continue;
      const geometry::Surface& surface = start_.geometry.surfaces[index(entity.entity)];
      if (surface.shape->contains(entity.at[0], entity.at[1])) continue;
      ++report.outside;
      outside.emplace(surface.tag, surface.number_text());
    }
    for (const auto& [tag, text] : outside) report.outside_surfaces.push_back(text);
  }

  const HighOrderMesh& linear_;
  const Association& start_;
  const Team& team_;
  CurvedMesh result_;
  std::vector<double> straight_;
};

/// "surfaces 3, 7 and 2 more", with at most ten of them, or "surface 3".
std::string list(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 10;
  std::string text = names.size() == 1 ? "surface " : "surfaces ";
  for (std::size_t i = 0; i < std::min(kShown, names.size()); ++i) text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > kShown) text += " and " + std::to_string(names.size() - kShown) + " more";
  return text;
}

std::vector<std::string> as_texts(const std::vector<int>& tags) {
  std::vector<std::string> texts;
  for (const int tag : tags) texts.push_back(std::to_string(tag));
  return texts;
}

std::string straight_text(std::int64_t count) {
  if (count == 0) return "";
  return " The boundary is curved at " + std::to_string(count) + (count == 1 ? " element" : " elements") +
         " with such nodes between their vertices.";
}

}  // namespace

std::vector<std::string> CurveReport::sentences() const {
  std::vector<std::string> result;
  result.push_back(
      "New nodes: " + std::to_string(on_curves) + " on curves, " + std::to_string(on_surfaces) + " on surfaces" +
      (in_layers > 0 ? ", " + std::to_string(in_layers) + " inside that follow the boundary in layers." : "."));
  if (held > 0)
    result.push_back(std::to_string(held) +
                     (held == 1 ? " new boundary node stays on a straight side, because it is not sure where it "
                                  "belongs; it lies on "
                                : " new boundary nodes stay on straight sides, because it is not sure where they "
                                  "belong; they lie on ") +
                     list(as_texts(held_tags)) + " of the mesh." + straight_text(straight));
  if (outside > 0)
    result.push_back(std::to_string(outside) +
                     (outside == 1 ? " new node lies outside the boundary of its surface, because the mesh is too "
                                     "coarse there; it is on "
                                   : " new nodes lie outside the boundary of their surface, because the mesh is too "
                                     "coarse there; they are on ") +
                     list(outside_surfaces) + " of the geometry.");
  return result;
}

Expected<CurvedMesh> curve(const HighOrderMesh& linear, const Association& association, int order, const Team& team) {
  auto raised = change_order(linear, order);
  if (!raised) return tl::unexpected(raised.error());
  return Curving(linear, association, std::move(*raised), team).run();
}

}  // namespace varimesh
