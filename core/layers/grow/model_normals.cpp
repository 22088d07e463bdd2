#include "core/layers/grow/model_normals.h"

#include <algorithm>

#include "core/base/index.h"

namespace varimesh::detail {

Eigen::Vector3d ModelNormals::at(std::int32_t element, std::int32_t node, const Eigen::Vector3d& like) const {
  // A straight element that leans more against its surface than this, the cosine of 60°, does not follow it.
  constexpr double kFollows = 0.5;
  if (model_ == nullptr || mesh_.dimension != 3) return like;
  const Cells::Range& range = elements_.range_of(varimesh::at(element));
  const std::vector<int>& surfaces = model_->surface_of_element[std::size_t(range.block - mesh_.blocks.data())];
  const std::size_t in_block = varimesh::at(element) - range.first;
  if (in_block >= surfaces.size() || surfaces[in_block] < 0) return like;
  const SurfaceNodes& of = model_->surfaces[varimesh::at(surfaces[in_block])];
  const auto found = std::ranges::lower_bound(of.nodes, node);
  if (found == of.nodes.end() || *found != node) return like;
  const auto& [u, v] = of.parameters[std::size_t(found - of.nodes.begin())];
  const geometry::SurfaceShape& shape = *model_->geometry.surfaces[varimesh::at(surfaces[in_block])].shape;
  const Eigen::Vector3d normal = shape.normal(shape.at(u, v), u, v);
  const double cosine = normal.dot(like);
  if (!(std::abs(cosine) > kFollows)) return like;
  return cosine > 0 ? normal : Eigen::Vector3d(-normal);
}

}  // namespace varimesh::detail
