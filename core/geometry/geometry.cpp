#include "core/geometry/geometry.h"

#include <cassert>

namespace varimesh::geometry {
namespace {

class ScaledCurve : public CurveShape {
 public:
  ScaledCurve(std::shared_ptr<const CurveShape> shape, double factor) : shape_(std::move(shape)), factor_(factor) {}
  CurvePoint at(double t) const override {
    const CurvePoint p = shape_->at(t);
    return {factor_ * p.x, factor_ * p.dt, factor_ * p.dtt};
  }
  Range range() const override { return shape_->range(); }
  int intervals() const override { return shape_->intervals(); }

 private:
  std::shared_ptr<const CurveShape> shape_;
  double factor_;
};

class ScaledSurface : public SurfaceShape {
 public:
  ScaledSurface(std::shared_ptr<const SurfaceShape> shape, double factor) : shape_(std::move(shape)), factor_(factor) {}
  SurfacePoint at(double u, double v) const override {
    const SurfacePoint p = shape_->at(u, v);
    return {factor_ * p.x, factor_ * p.du, factor_ * p.dv, factor_ * p.duu, factor_ * p.duv, factor_ * p.dvv};
  }
  Range u_range() const override { return shape_->u_range(); }
  Range v_range() const override { return shape_->v_range(); }
  std::array<int, 2> intervals() const override { return shape_->intervals(); }
  bool contains(double u, double v) const override { return shape_->contains(u, v); }

 private:
  std::shared_ptr<const SurfaceShape> shape_;
  double factor_;
};

}  // namespace

double size(const Geometry& geometry) {
  constexpr int kSamples = 8;
  Eigen::AlignedBox3d box;
  const auto extend = [&](const Eigen::Vector3d& x) {
    if (x.allFinite()) box.extend(x);
  };
  const auto place = [](const Range& range, int i) { return range.first + range.length() * i / kSamples; };
  for (const Vertex& vertex : geometry.vertices) extend(vertex.x);
  for (const Curve& curve : geometry.curves)
    for (int i = 0; i <= kSamples; ++i) extend(curve.shape->at(place(curve.shape->range(), i)).x);
  for (const Surface& surface : geometry.surfaces)
    for (int i = 0; i <= kSamples; ++i)
      for (int j = 0; j <= kSamples; ++j) {
        const double u = place(surface.shape->u_range(), i), v = place(surface.shape->v_range(), j);
        const Eigen::Vector3d x = surface.shape->at(u, v).x;
        // Whether the surface contains a point is a slow question.
        if (!box.contains(x) && surface.shape->contains(u, v)) extend(x);
      }
  return box.isEmpty() ? 0 : box.diagonal().norm();
}

Geometry scaled(const Geometry& geometry, double factor) {
  Geometry result = geometry;
  for (Vertex& vertex : result.vertices) vertex.x *= factor;
  for (Curve& curve : result.curves) curve.shape = std::make_shared<ScaledCurve>(curve.shape, factor);
  for (Surface& surface : result.surfaces) {
    assert(surface.shape->pieces() == nullptr);
    surface.shape = std::make_shared<ScaledSurface>(surface.shape, factor);
  }
  return result;
}

}  // namespace varimesh::geometry
