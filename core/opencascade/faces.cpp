#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_ConicalSurface.hxx>
#include <Geom_Plane.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Geom_Surface.hxx>
#include <Geom_SurfaceOfRevolution.hxx>
#include <Geom_ToroidalSurface.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <algorithm>
#include <limits>

#include "core/opencascade/face_interior.h"
#include "core/opencascade/shapes.h"
#include "core/opencascade/spline_patches.h"

namespace varimesh::cad {
namespace {

using geometry::Range;
using geometry::SurfacePoint;

// Geom_Surface has no caches, so threads may share it.
class FaceSurface : public geometry::SurfaceShape {
 public:
  /// @param u_period, v_period  of the surface; 0: not periodic
  /// @param patches  of the surface; null: it has none
  FaceSurface(const TopoDS_Face& face, const Handle(Geom_Surface) & surface,
              std::shared_ptr<const SplinePatches> patches, const Range& u, const Range& v, double u_period,
              double v_period)
      : surface_(surface), patches_(std::move(patches)), u_(u), v_(v), interior_(face, u, v, u_period, v_period) {}

  SurfacePoint at(double u, double v) const override {
    try {
      if (patches_ != nullptr) return patches_->at(u, v);
      gp_Pnt x;
      gp_Vec du, dv, duu, dvv, duv;
      surface_->D2(u, v, x, du, dv, duu, dvv, duv);
      return {vector(x.XYZ()),   vector(du.XYZ()),  vector(dv.XYZ()),
              vector(duu.XYZ()), vector(duv.XYZ()), vector(dvv.XYZ())};
    } catch (const Standard_Failure&) {
      const Eigen::Vector3d none = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
      return {none, none, none, none, none, none};
    }
  }
  Range u_range() const override { return u_; }
  Range v_range() const override { return v_; }

  std::array<int, 2> intervals() const override {
    constexpr int kMost = 150;
    if (!Handle(Geom_Plane)::DownCast(surface_).IsNull()) return {2, 2};
    const auto spline = Handle(Geom_BSplineSurface)::DownCast(surface_);
    if (spline.IsNull()) return {24, 24};
    return {std::clamp(2 * (spline->NbUKnots() - 1), 16, kMost), std::clamp(2 * (spline->NbVKnots() - 1), 16, kMost)};
  }

  bool contains(double u, double v) const override { return interior_.contains(u, v); }

 private:
  Handle(Geom_Surface) surface_;
  std::shared_ptr<const SplinePatches> patches_;
  Range u_, v_;
  FaceInterior interior_;
};

/// Makes the range of a face periodic if the face goes all the way round its surface. Otherwise says how far the
/// surface goes on beyond the face, up to the length of the range.
/// @param period of the surface; 0: not periodic
/// @param least  where the surface begins, maybe −∞
void extend(double period, double least, double most, Range& range) {
  const double margin = range.length();
  if (period > 0 && range.length() > (1 - 1e-9) * period) {
    range.period = period;
  } else if (period > 0) {
    range.margin_before = range.margin_after = std::min(margin, (period - range.length()) / 2);
  } else {
    range.margin_before = std::clamp(range.first - least, 0.0, margin);
    range.margin_after = std::clamp(most - range.last, 0.0, margin);
  }
}

/// A surface that is turned around an axis in u may reach the axis, as a cone does at its tip. Beyond, it goes on with
/// another part, which is not the face's. Ends the margins there.
void end_at_axis(const Handle(Geom_Surface) & surface, double u, Range& v) {
  constexpr int kSteps = 64, kHalvings = 50;
  if (Handle(Geom_ConicalSurface)::DownCast(surface).IsNull() &&
      Handle(Geom_ToroidalSurface)::DownCast(surface).IsNull() &&
      Handle(Geom_SurfaceOfRevolution)::DownCast(surface).IsNull())
    return;
  const auto around = [&](double at) {
    gp_Pnt x;
    gp_Vec du, dv;
    surface->D1(u, at, x, du, dv);
    return du;
  };
  const gp_Vec inside = around(v.first + 0.5 * v.length());
  const auto shorten = [&](double end, double sense, double& margin) {
    for (int step = 1; step <= kSteps; ++step) {
      double beyond = margin * step / kSteps;
      if (around(end + sense * beyond) * inside > 0) continue;
      double before = margin * (step - 1) / kSteps;
      for (int half = 0; half < kHalvings; ++half) {
        const double middle = 0.5 * (before + beyond);
        (around(end + sense * middle) * inside > 0 ? before : beyond) = middle;
      }
      margin = before;
      return;
    }
  };
  shorten(v.first, -1, v.margin_before);
  shorten(v.last, 1, v.margin_after);
}

}  // namespace

std::shared_ptr<const geometry::SurfaceShape> surface_shape(const TopoDS_Face& face, SharedPatches& shared) {
  Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
  if (surface.IsNull()) return nullptr;
  // A trimmed surface forgets that it was periodic.
  while (true) {
    const auto trimmed = Handle(Geom_RectangularTrimmedSurface)::DownCast(surface);
    if (trimmed.IsNull()) break;
    surface = trimmed->BasisSurface();
  }
  Range u, v;
  BRepTools::UVBounds(face, u.first, u.last, v.first, v.last);
  for (const Range& range : {u, v})
    if (!(range.first < range.last) || Precision::IsInfinite(range.first) || Precision::IsInfinite(range.last))
      return nullptr;
  double u_least = 0, u_most = 0, v_least = 0, v_most = 0;
  surface->Bounds(u_least, u_most, v_least, v_most);
  const double u_period = surface->IsUPeriodic() ? surface->UPeriod() : 0;
  const double v_period = surface->IsVPeriodic() ? surface->VPeriod() : 0;
  extend(u_period, u_least, u_most, u);
  extend(v_period, v_least, v_most, v);
  end_at_axis(surface, u.first, v);
  return std::make_shared<FaceSurface>(face, surface, shared.of(surface), u, v, u_period, v_period);
}

}  // namespace varimesh::cad
