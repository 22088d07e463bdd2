#include "core/association/file_parameters.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/closest_point.h"
#include "core/mesh/node_parameters.h"

namespace varimesh {
namespace {

/// Parameters that lead to the node within this, relative to the size, are exact.
constexpr double kExact = 1e-10;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool may_be_at(const geometry::Range& range, double t) { return std::isfinite(t) && range.clamp(t) == t; }

/// The same parameter in first ≤ t < first + period.
double in_first_period(const geometry::Range& range, double t) {
  if (range.period <= 0 || (t >= range.first && t <= range.last)) return t;
  return t - range.period * std::floor((t - range.first) / range.period);
}

/// The parameters of a node in the ranges of its entity.
std::array<double, 2> parameters_of(const geometry::Geometry& geometry, const NodeEntity& node) {
  const auto index = static_cast<std::size_t>(node.entity);
  if (node.dimension == 1) return {in_first_period(geometry.curves[index].shape->range(), node.at[0]), 0};
  const geometry::SurfaceShape& shape = *geometry.surfaces[index].shape;
  return {in_first_period(shape.u_range(), node.at[0]), in_first_period(shape.v_range(), node.at[1])};
}

/// Whether all nodes of the block belong to one entity of its dimension.
bool is_on_one_entity(const NodeBlock& block, const Association& association) {
  const auto begin = association.nodes.begin() + block.first;
  return std::all_of(begin, begin + block.count, [&](const NodeEntity& node) {
    return node.dimension == block.dimension && node.entity == begin->entity;
  });
}

}  // namespace

void keep_parameters(HighOrderMesh& mesh, const Association& association) {
  for (NodeBlock& block : mesh.node_blocks) {
    if (block.parameters.empty()) continue;
    if (!has_parameters(block) || !is_on_one_entity(block, association)) {
      block.parameters = {};
      continue;
    }
    const std::size_t per_node = parameters_per_node(block.dimension);
    for (std::size_t i = 0; i < static_cast<std::size_t>(block.count); ++i) {
      const NodeEntity& node = association.nodes[static_cast<std::size_t>(block.first) + i];
      const auto at = parameters_of(association.geometry, node);
      std::copy_n(at.begin(), per_node, block.parameters.begin() + static_cast<std::ptrdiff_t>(per_node * i));
    }
  }
}

namespace detail {

FilePlaces::FilePlaces(const HighOrderMesh& mesh)
    : blocks_(mesh.node_blocks), any_(std::ranges::any_of(blocks_, has_parameters)) {}

FilePlace FilePlaces::of(std::int32_t node) const {
  const auto after = std::ranges::upper_bound(blocks_, node, {}, &NodeBlock::first);
  if (after == blocks_.begin()) return {};
  const NodeBlock& block = *(after - 1);
  if (block.dimension < 0 || node >= block.first + block.count) return {};
  FilePlace place{block.dimension, block.entity, has_parameters(block), {}};
  if (!place.has_parameters) return place;
  const std::size_t per_node = parameters_per_node(block.dimension);
  std::copy_n(block.parameters.begin() + static_cast<std::ptrdiff_t>(per_node) * (node - block.first), per_node,
              place.at.begin());
  return place;
}

geometry::CurveFoot foot_at(const geometry::CurveShape& curve, const Eigen::Vector3d& x, double t, double size) {
  if (!may_be_at(curve.range(), t)) return {0, {}, kInfinity};
  const Eigen::Vector3d there = curve.at(t).x;
  const double distance = (there - x).norm();
  if (distance <= kExact * size) return {t, there, distance};
  if (!(distance <= kParameterTolerance * size)) return {0, {}, kInfinity};
  return geometry::closest_from(curve, x, t);
}

geometry::SurfaceFoot foot_at(const geometry::SurfaceShape& surface, const Eigen::Vector3d& x,
                              const std::array<double, 2>& at, double size) {
  if (!may_be_at(surface.u_range(), at[0]) || !may_be_at(surface.v_range(), at[1])) return {0, 0, {}, kInfinity};
  const Eigen::Vector3d there = surface.at(at[0], at[1]).x;
  const double distance = (there - x).norm();
  if (distance <= kExact * size) return {at[0], at[1], there, distance};
  if (!(distance <= kParameterTolerance * size)) return {0, 0, {}, kInfinity};
  return geometry::closest_from(surface, x, at[0], at[1]);
}

}  // namespace detail
}  // namespace varimesh
