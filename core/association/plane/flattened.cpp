#include "core/association/plane/flattened.h"

#include <Eigen/Geometry>
#include <memory>
#include <utility>

#include "core/association/plane/profile.h"

namespace varimesh {
namespace {

class MovedCurve : public geometry::CurveShape {
 public:
  MovedCurve(std::shared_ptr<const geometry::CurveShape> shape, const Eigen::Isometry3d& by)
      : shape_(std::move(shape)), by_(by) {}
  geometry::CurvePoint at(double t) const override {
    const geometry::CurvePoint p = shape_->at(t);
    return {by_ * p.x, by_.linear() * p.dt, by_.linear() * p.dtt};
  }
  geometry::Range range() const override { return shape_->range(); }
  int intervals() const override { return shape_->intervals(); }

 private:
  std::shared_ptr<const geometry::CurveShape> shape_;
  Eigen::Isometry3d by_;
};

/// From space into the coordinates of the plane.
Eigen::Isometry3d into(const Plane& plane) {
  const auto at = [&](double u, double v) {
    const auto x = plane.in_space(u, v);
    return Eigen::Vector3d(x[0], x[1], x[2]);
  };
  Eigen::Isometry3d from = Eigen::Isometry3d::Identity();
  from.translation() = at(0, 0);
  from.linear().col(0) = at(1, 0) - at(0, 0);
  from.linear().col(1) = at(0, 1) - at(0, 0);
  from.linear().col(2) = Eigen::Vector3d(plane.normal()[0], plane.normal()[1], plane.normal()[2]);
  return from.inverse();
}

}  // namespace

Expected<Association> associate_flattened(const HighOrderMesh& flat, const Plane& plane,
                                          const geometry::Geometry& geometry, const Team& team) {
  const Eigen::Isometry3d by = into(plane);
  geometry::Geometry moved;
  for (geometry::Vertex vertex : geometry.vertices) {
    vertex.x = by * vertex.x;
    moved.vertices.push_back(std::move(vertex));
  }
  for (geometry::Curve curve : geometry.curves) {
    curve.shape = std::make_shared<MovedCurve>(curve.shape, by);
    curve.surfaces.clear();  // those of the model do not count in a plane
    moved.curves.push_back(std::move(curve));
  }
  return associate_in_plane(flat, moved, team);
}

}  // namespace varimesh
