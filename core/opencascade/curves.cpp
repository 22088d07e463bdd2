#include <BRep_Tool.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_Curve.hxx>
#include <Geom_TrimmedCurve.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <algorithm>
#include <limits>

#include "core/opencascade/shapes.h"

namespace varimesh::cad {
namespace {

using geometry::CurvePoint;
using geometry::Range;

// Geom_Curve has no caches, so threads may share it; adaptors have them.
class EdgeCurve : public geometry::CurveShape {
 public:
  EdgeCurve(const Handle(Geom_Curve) & curve, const Range& range) : curve_(curve), range_(range) {}

  CurvePoint at(double t) const override {
    try {
      gp_Pnt x;
      gp_Vec first, second;
      curve_->D2(t, x, first, second);
      return {vector(x.XYZ()), vector(first.XYZ()), vector(second.XYZ())};
    } catch (const Standard_Failure&) {
      const Eigen::Vector3d none = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
      return {none, none, none};
    }
  }
  Range range() const override { return range_; }
  int intervals() const override {
    constexpr int kMost = 500;
    const auto spline = Handle(Geom_BSplineCurve)::DownCast(curve_);
    return spline.IsNull() ? 24 : std::clamp(2 * (spline->NbKnots() - 1), 24, kMost);
  }

 private:
  Handle(Geom_Curve) curve_;
  Range range_;
};

}  // namespace

std::shared_ptr<const geometry::CurveShape> curve_shape(const TopoDS_Edge& edge) {
  if (BRep_Tool::Degenerated(edge)) return nullptr;
  double first = 0, last = 0;
  Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, first, last);
  if (curve.IsNull() || !(first < last) || Precision::IsInfinite(first) || Precision::IsInfinite(last)) return nullptr;
  // The ends of a trimmed curve would hold a node that may pass them on the whole, periodic curve.
  while (true) {
    const auto trimmed = Handle(Geom_TrimmedCurve)::DownCast(curve);
    if (trimmed.IsNull()) break;
    curve = trimmed->BasisCurve();
  }
  Range range{first, last, 0};
  if (curve->IsPeriodic() && last - first > (1 - 1e-9) * curve->Period()) range.period = curve->Period();
  return std::make_shared<EdgeCurve>(curve, range);
}

}  // namespace varimesh::cad
