#include "core/layers/grow/model_normals.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/curved_sides.h"

namespace varimesh::detail {

ModelNormals::ModelNormals(const HighOrderMesh& mesh, const Cells& elements, const Association* model)
    : mesh_(mesh), elements_(elements), model_(model) {
  if (model_ == nullptr || !model_->in_plane) return;
  for (std::size_t c = 0; c < model_->geometry.curves.size(); ++c)
    curves_.emplace(static_cast<int>(c), geometry::CurveSearch(*model_->geometry.curves[c].shape));
}

Eigen::Vector3d ModelNormals::at(std::int32_t element, std::int32_t node, const Eigen::Vector3d& like) const {
  // A straight element that leans more against its surface than this, the cosine of 60°, does not follow it.
  constexpr double kFollows = 0.5;
  if (model_ == nullptr || model_->in_plane != (mesh_.dimension == 2)) return like;
  const Eigen::Vector3d normal = model_->in_plane ? of_curve(element, node) : of_surface(element, node);
  const double cosine = normal.dot(like);
  if (!(std::abs(cosine) > kFollows)) return like;
  return cosine > 0 ? normal : Eigen::Vector3d(-normal);
}

/// Zero if it is not known.
Eigen::Vector3d ModelNormals::of_curve(std::int32_t element, std::int32_t node) const {
  const auto nodes = elements_.nodes(varimesh::at(element));
  const int curve = curve_of_edge(*model_, nodes[0], nodes[1]);
  if (curve < 0) return Eigen::Vector3d::Zero();
  const geometry::CurveFoot foot = curves_.at(curve).closest(point(mesh_, node));
  const Eigen::Vector3d along = model_->geometry.curves[varimesh::at(curve)].shape->at(foot.t).dt;
  return along.cross(Eigen::Vector3d(0, 0, 1)).normalized();
}

/// Zero if it is not known.
Eigen::Vector3d ModelNormals::of_surface(std::int32_t element, std::int32_t node) const {
  const Cells::Range& range = elements_.range_of(varimesh::at(element));
  const std::vector<int>& surfaces = model_->surface_of_element[std::size_t(range.block - mesh_.blocks.data())];
  const std::size_t in_block = varimesh::at(element) - range.first;
  if (in_block >= surfaces.size() || surfaces[in_block] < 0) return Eigen::Vector3d::Zero();
  const SurfaceNodes& of = model_->surfaces[varimesh::at(surfaces[in_block])];
  const auto found = std::ranges::lower_bound(of.nodes, node);
  if (found == of.nodes.end() || *found != node) return Eigen::Vector3d::Zero();
  const auto& [u, v] = of.parameters[std::size_t(found - of.nodes.begin())];
  const geometry::SurfaceShape& shape = *model_->geometry.surfaces[varimesh::at(surfaces[in_block])].shape;
  return shape.normal(shape.at(u, v), u, v);
}

}  // namespace varimesh::detail
