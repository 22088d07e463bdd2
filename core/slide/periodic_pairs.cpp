#include "core/slide/periodic_pairs.h"

#include <Eigen/QR>
#include <algorithm>

#include "core/geometry/closest_point.h"

namespace varimesh::detail {
namespace {

/// Links that are off by less than this, relative to the mesh's size, hold.
constexpr double kRounding = 1e-12;
/// Pairs that are off by less than this, over kRounding, have slid to the same place.
constexpr double kSamePlace = 1e5;

Eigen::Vector3d position(const std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<const Eigen::Vector3d>(&coordinates[3 * static_cast<std::size_t>(node)]);
}

/// The least map, in the sense of least squares, from each master's node to its image.
Eigen::Matrix<double, 3, 4> fitted(const PeriodicLink& link, const std::vector<double>& coordinates) {
  const auto count = static_cast<Eigen::Index>(link.nodes.size());
  Eigen::MatrixXd from(count, 4), to(count, 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [node, master] = link.nodes[static_cast<std::size_t>(i)];
    from.row(i) << position(coordinates, master).transpose(), 1;
    to.row(i) = position(coordinates, node).transpose();
  }
  return from.completeOrthogonalDecomposition().solve(to).transpose();
}

}  // namespace

PeriodicPairs::PeriodicPairs(const HighOrderMesh& mesh, double size) : rounding_(kRounding * size) {
  for (const PeriodicLink& of : mesh.periodic) {
    if (of.nodes.empty()) continue;
    Link link{&of, {}, 0};
    if (of.affine.size() == 16)
      link.map = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(of.affine.data()).topRows<3>();
    else
      link.map = fitted(of, mesh.coordinates);
    link.off = off(link, mesh.coordinates);
    links_.push_back(link);
  }
}

double PeriodicPairs::off(const Link& link, const std::vector<double>& coordinates) {
  double largest = 0;
  for (const auto& [node, master] : link.of->nodes)
    largest = std::max(largest, (image(link, coordinates, master) - position(coordinates, node)).norm());
  return largest;
}

Eigen::Vector3d PeriodicPairs::image(const Link& link, const std::vector<double>& coordinates, std::int32_t master) {
  return link.map.leftCols<3>() * position(coordinates, master) + link.map.col(3);
}

void PeriodicPairs::put_on_images(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed) const {
  std::vector<bool> moved(mesh.node_count(), false);
  for (const Link& link : links_) {
    const double now = off(link, mesh.coordinates);
    if (now <= std::max(link.off, rounding_) || now > kSamePlace * rounding_) continue;
    for (const auto& [node, master] : link.of->nodes) {
      const auto i = static_cast<std::size_t>(node);
      if (fixed[i] || association.nodes[i].dimension < 1) continue;
      Eigen::Map<Eigen::Vector3d>(&mesh.coordinates[3 * i]) = image(link, mesh.coordinates, master);
      moved[i] = true;
    }
  }
  for (std::size_t i = 0; i < moved.size(); ++i) {
    NodeEntity& entity = association.nodes[i];
    if (!moved[i] || entity.dimension != 1) continue;
    const auto foot =
        geometry::closest_from(*association.geometry.curves[static_cast<std::size_t>(entity.entity)].shape,
                               position(mesh.coordinates, static_cast<std::int32_t>(i)), entity.at[0]);
    entity.at[0] = foot.t;
    entity.distance = foot.distance;
  }
  for (std::size_t s = 0; s < association.surfaces.size(); ++s) {
    SurfaceNodes& own = association.surfaces[s];
    for (std::size_t k = 0; k < own.nodes.size(); ++k) {
      const auto i = static_cast<std::size_t>(own.nodes[k]);
      if (!moved[i]) continue;
      const auto foot =
          geometry::closest_from(*association.geometry.surfaces[s].shape, position(mesh.coordinates, own.nodes[k]),
                                 own.parameters[k][0], own.parameters[k][1]);
      own.parameters[k] = {foot.u, foot.v};
      if (association.nodes[i].dimension != 2) continue;
      association.nodes[i].at = own.parameters[k];
      association.nodes[i].distance = foot.distance;
    }
  }
}

void PeriodicPairs::fix(const Link& link, std::vector<bool>& fixed) {
  for (const auto& [node, master] : link.of->nodes)
    fixed[static_cast<std::size_t>(node)] = fixed[static_cast<std::size_t>(master)] = true;
}

bool PeriodicPairs::fix_broken(const std::vector<double>& coordinates, std::vector<bool>& fixed) const {
  bool any = false;
  for (const Link& link : links_) {
    if (off(link, coordinates) <= std::max(link.off, rounding_)) continue;
    fix(link, fixed);
    any = true;
  }
  return any;
}

void PeriodicPairs::fix_all(std::vector<bool>& fixed) const {
  for (const Link& link : links_) fix(link, fixed);
}

}  // namespace varimesh::detail
