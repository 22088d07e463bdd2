#include "core/layers/grow/curved_sides.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/association/own_boundary.h"
#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/own_curves.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// Two facets lie in one plane if the sine of the angle between them is at most this.
constexpr double kSamePlane = 1e-4;

std::set<std::int32_t> vertices_of_walls(std::span<const OuterFacet> outer) {
  std::set<std::int32_t> vertices;
  for (const OuterFacet& facet : outer)
    if (facet.is_wall) vertices.insert(facet.corners().begin(), facet.corners().end());
  return vertices;
}

bool meets(const OuterFacet& facet, const std::set<std::int32_t>& vertices) {
  return std::ranges::any_of(facet.corners(), [&](std::int32_t vertex) { return vertices.contains(vertex); });
}

bool end_at_curved_facets(std::span<const OuterFacet> outer) {
  const std::set<std::int32_t> on_wall = vertices_of_walls(outer);
  return std::ranges::any_of(
      outer, [&](const OuterFacet& facet) { return !facet.is_wall && !facet.is_plane && meets(facet, on_wall); });
}

std::vector<std::int32_t> sorted(std::span<const std::int32_t> vertices) {
  std::vector<std::int32_t> found(vertices.begin(), vertices.end());
  std::ranges::sort(found);
  return found;
}

}  // namespace

int curve_of_edge(const Association& model, std::int32_t one, std::int32_t other) {
  const auto has = [&](std::size_t curve, std::int32_t node) {
    const NodeEntity& at_node = model.nodes[at(node)];
    const std::vector<int>& ends = model.geometry.curves[curve].vertices;
    return (at_node.dimension == 1 && at(at_node.entity) == curve) ||
           (at_node.dimension == 0 && std::ranges::find(ends, at_node.entity) != ends.end());
  };
  int found = -1;
  for (std::size_t curve = 0; curve < model.geometry.curves.size(); ++curve) {
    if (!has(curve, one) || !has(curve, other)) continue;
    if (found >= 0) return -1;  // an edge between two vertices that several curves join
    found = static_cast<int>(curve);
  }
  return found;
}

CurvedSides::CurvedSides(const CheckedMesh& mesh, std::span<const OuterFacet> outer, const Association* model,
                         const Team& team)
    : dimension_(mesh.mesh.dimension), shapes_(model) {
  // Straight facets may lie on a curved surface of the model.
  if (shapes_ == nullptr && end_at_curved_facets(outer)) find_own(mesh, outer, team);
  if (shapes_ != nullptr) note_nodes(mesh, outer);
}

void CurvedSides::find_own(const CheckedMesh& checked, std::span<const OuterFacet> outer, const Team& team) {
  const HighOrderMesh& mesh = checked.mesh;
  if (dimension_ == 2) {
    own_ = std::make_shared<const Association>(own_curves(mesh, outer, own_side_));
  } else {
    auto own = own_boundary(mesh, team);
    if (!own) return;
    for (std::size_t b = 0; b < own->faces.blocks.size(); ++b) {
      const ElementBlock& block = own->faces.blocks[b];
      const std::size_t stride = block.nodes.size() / block.size(), count = at(reference::info(block.shape).vertices);
      for (std::size_t e = 0; e < block.size(); ++e)
        own_side_[sorted(std::span(block.nodes).subspan(e * stride, count))] =
            own->association.surface_of_element[b][e];
    }
    own_ = std::make_shared<const Association>(std::move(own->association));
  }
  shapes_ = own_.get();
}

std::vector<int> CurvedSides::sides_of(const CheckedMesh& checked, std::span<const OuterFacet> outer) const {
  const HighOrderMesh& mesh = checked.mesh;
  const Cells elements(mesh, dimension_ - 1);
  std::vector<int> found;
  for (const OuterFacet& facet : outer) {
    int side = -1;
    if (own_ != nullptr) {
      const auto known = own_side_.find(sorted(facet.corners()));
      side = known == own_side_.end() ? -1 : known->second;
    } else if (dimension_ == 2) {
      side = curve_of_edge(*shapes_, facet.nodes[0], facet.nodes[1]);
    } else if (facet.element >= 0) {
      const Cells::Range& range = elements.range_of(at(facet.element));
      const auto& of_block = shapes_->surface_of_element[std::size_t(range.block - mesh.blocks.data())];
      if (const std::size_t e = at(facet.element) - range.first; e < of_block.size()) side = of_block[e];
    }
    found.push_back(side);
  }
  return found;
}

void CurvedSides::note_nodes(const CheckedMesh& mesh, std::span<const OuterFacet> outer) {
  const std::vector<int> side_of = sides_of(mesh, outer);
  const std::set<std::int32_t> on_wall = vertices_of_walls(outer);
  std::set<int> touching, curved;
  std::map<int, const OuterFacet*> first;
  for (std::size_t f = 0; f < outer.size(); ++f) {
    if (outer[f].is_wall || side_of[f] < 0) continue;
    if (meets(outer[f], on_wall)) touching.insert(side_of[f]);
    const OuterFacet& like = *first.try_emplace(side_of[f], &outer[f]).first->second;
    if (!outer[f].is_plane || like.normal.cross(outer[f].normal).norm() > kSamePlane) curved.insert(side_of[f]);
  }
  for (std::size_t f = 0; f < outer.size(); ++f) {
    if (outer[f].is_wall) continue;
    for (const std::int32_t node : outer[f].nodes) {
      OfNode& here = nodes_[node];
      here.x = point(mesh.mesh, node);
      if (touching.contains(side_of[f]))
        here.sides.insert(side_of[f]);
      else
        here.stays = true;
    }
  }
  std::erase_if(nodes_, [&](const auto& node) {
    return std::ranges::none_of(node.second.sides, [&](int side) { return curved.contains(side); });
  });
  note_curves(touching);
}

void CurvedSides::note_curves(const std::set<int>& sides) {
  for (std::size_t c = 0; c < shapes_->geometry.curves.size(); ++c) {
    const auto number = static_cast<int>(c);
    const std::vector<int>& around = shapes_->geometry.curves[c].surfaces;
    const bool is_between = std::ranges::count_if(around, [&](int surface) { return sides.contains(surface); }) > 1;
    if (dimension_ == 2 ? sides.contains(number) : is_between)
      curves_.emplace(number, geometry::CurveSearch(*shapes_->geometry.curves[c].shape));
  }
}

CurvedSides::CurvePlace CurvedSides::on_curve(const OfNode& node, const Vector& to) const {
  CurvePlace place;
  for (const auto& known : curves_) {
    const int number = known.first;
    const geometry::Curve& curve = shapes_->geometry.curves[at(number)];
    const bool is_of_all = std::ranges::all_of(node.sides, [&](int side) {
      return dimension_ == 2 ? side == number : std::ranges::find(curve.surfaces, side) != curve.surfaces.end();
    });
    if (!is_of_all) continue;
    const geometry::CurveFoot foot = known.second.closest(to);
    if (place.shape == nullptr || foot.distance < place.foot.distance) place = {curve.shape.get(), foot};
  }
  if (!std::isfinite(place.foot.distance)) place.shape = nullptr;
  return place;
}

const std::array<double, 2>* CurvedSides::parameters(std::int32_t node, int surface) const {
  const SurfaceNodes& of = shapes_->surfaces[at(surface)];
  const auto found = std::ranges::lower_bound(of.nodes, node);
  return found == of.nodes.end() || *found != node ? nullptr : &of.parameters[std::size_t(found - of.nodes.begin())];
}

std::vector<Vector> CurvedSides::directions(std::int32_t vertex) const {
  const OfNode& node = nodes_.at(vertex);
  const auto most = at(dimension_ - 1);
  if (node.stays || node.sides.size() > most) return {};
  if (node.sides.size() == most) {
    const CurvePlace place = on_curve(node, node.x);
    if (place.shape == nullptr) return {};
    const Vector along = place.shape->at(place.foot.t).dt.normalized();
    return along.allFinite() ? std::vector<Vector>{along} : std::vector<Vector>();
  }
  const int surface = *node.sides.begin();
  const std::array<double, 2>* place = parameters(vertex, surface);
  if (place == nullptr) return {};
  const geometry::SurfaceShape& shape = *shapes_->geometry.surfaces[at(surface)].shape;
  const Vector normal = shape.normal(shape.at((*place)[0], (*place)[1]), (*place)[0], (*place)[1]);
  if (!(normal.norm() > 0.5)) return {};  // a pole
  const Vector along = normal.unitOrthogonal();
  return {along, normal.cross(along)};
}

Vector CurvedSides::nearest(std::int32_t node, const Vector& to) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return to;
  const OfNode& of = found->second;
  const auto most = at(dimension_ - 1);
  if (of.sides.size() == most) {
    const CurvePlace place = on_curve(of, to);
    if (place.shape == nullptr) return to;
    return dimension_ == 2 ? Vector(place.foot.x[0], place.foot.x[1], to[2]) : place.foot.x;
  }
  const std::array<double, 2>* place = of.sides.size() == 1 ? parameters(node, *of.sides.begin()) : nullptr;
  if (place == nullptr) return to;
  const geometry::SurfaceShape& shape = *shapes_->geometry.surfaces[at(*of.sides.begin())].shape;
  const geometry::SurfaceFoot foot = geometry::closest_from(shape, to, (*place)[0], (*place)[1]);
  return std::isfinite(foot.distance) ? foot.x : to;
}

}  // namespace varimesh::detail
