#include "core/opencascade/spline_patches.h"

#include <BSplCLib.hxx>
#include <algorithm>
#include <cmath>
#include <math_Matrix.hxx>

#include "core/opencascade/outline.h"
#include "core/opencascade/shapes.h"

namespace varimesh::cad {
namespace {

/// The coefficients of a polynomial of this degree in s may be about 3^degree times as large as its values.
constexpr int kMostDegree = 9;
/// The number of points at which the patches are compared with the surface when they are made, and how far these may be
/// apart, relative to the largest coordinate.
constexpr int kSamples = 16;
constexpr double kRounding = 1e-10;

/// A polynomial in one variable and its first and second derivatives, by Horner's method.
/// @param coefficient  that of the k-th power
template <class Number, class Coefficient>
std::array<Number, 3> derivatives(int degree, double s, const Coefficient& coefficient) {
  Number value = coefficient(degree), first = Number::Zero(), half_second = Number::Zero();
  for (int k = degree - 1; k >= 0; --k) {
    half_second = half_second * s + first;
    first = first * s + value;
    value = value * s + coefficient(k);
  }
  return {value, first, Number(2 * half_second)};
}

}  // namespace

std::unique_ptr<SplinePatches> SplinePatches::make(const Handle(Geom_BSplineSurface) & surface) {
  if (std::max(surface->UDegree(), surface->VDegree()) > kMostDegree) return nullptr;
  auto patches = std::unique_ptr<SplinePatches>(new SplinePatches(surface));
  return patches->agree_with(surface) ? std::move(patches) : nullptr;
}

bool SplinePatches::agree_with(const Handle(Geom_BSplineSurface) & surface) const {
  double u_first = 0, u_last = 0, v_first = 0, v_last = 0, farthest = 0, largest = 0;
  surface->Bounds(u_first, u_last, v_first, v_last);
  for (const auto& [u, v] : spread_points(kSamples)) {
    const double at_u = u_first + u * (u_last - u_first), at_v = v_first + v * (v_last - v_first);
    const Eigen::Vector3d theirs = vector(surface->Value(at_u, at_v).XYZ()), off = at(at_u, at_v).x - theirs;
    if (!off.allFinite()) return false;
    farthest = std::max(farthest, off.norm());
    largest = std::max(largest, theirs.norm());
  }
  return farthest <= kRounding * largest;
}

SplinePatches::SplinePatches(const Handle(Geom_BSplineSurface) & surface)
    : surface_(surface), is_rational_(surface->IsURational() || surface->IsVRational()) {
  const double u_period = surface->IsUPeriodic() ? surface->UPeriod() : 0;
  const double v_period = surface->IsVPeriodic() ? surface->VPeriod() : 0;
  if (u_period > 0 || v_period > 0) {
    surface_ = Handle(Geom_BSplineSurface)::DownCast(surface->Copy());
    if (u_period > 0) surface_->SetUNotPeriodic();
    if (v_period > 0) surface_->SetVNotPeriodic();
  }
  directions_[0].period = u_period;
  directions_[1].period = v_period;
  directions_[0].degree = surface_->UDegree();
  directions_[1].degree = surface_->VDegree();
  for (int k = surface_->FirstUKnotIndex(); k <= surface_->LastUKnotIndex(); ++k)
    directions_[0].knots.push_back(surface_->UKnot(k));
  for (int k = surface_->FirstVKnotIndex(); k <= surface_->LastVKnotIndex(); ++k)
    directions_[1].knots.push_back(surface_->VKnot(k));
  TColStd_Array1OfReal all_u(1, surface_->NbUPoles() + surface_->UDegree() + 1);
  TColStd_Array1OfReal all_v(1, surface_->NbVPoles() + surface_->VDegree() + 1);
  surface_->UKnotSequence(all_u);
  surface_->VKnotSequence(all_v);
  directions_[0].make_spans(all_u);
  directions_[1].make_spans(all_v);
  std::vector<std::atomic<const Patch*>> none(directions_[0].spans.size() * directions_[1].spans.size());
  patches_.swap(none);
}

void SplinePatches::Direction::make_spans(const TColStd_Array1OfReal& all) {
  math_Matrix basis(1, degree + 1, 1, degree + 1);  // derivative × pole
  for (std::size_t span = 0; span + 1 < knots.size(); ++span) {
    Span& made = spans.emplace_back();
    BSplCLib::EvalBsplineBasis(degree, degree + 1, all, middle(span), made.first_pole, basis);
    made.powers.resize(degree + 1, degree + 1);
    double scale = 1;  // half_length^a / a!
    for (int a = 0; a <= degree; ++a) {
      for (int pole = 0; pole <= degree; ++pole) made.powers(a, pole) = scale * basis(a + 1, pole + 1);
      scale *= half_length(span) / (a + 1);
    }
  }
}

SplinePatches::~SplinePatches() {
  for (const std::atomic<const Patch*>& patch : patches_) delete patch.load();
}

double SplinePatches::Direction::into_period(double t) const {
  return period > 0 ? t - period * std::floor((t - knots.front()) / period) : t;
}

std::size_t SplinePatches::Direction::find(double t) const {
  const auto after = std::upper_bound(knots.begin() + 1, knots.end() - 1, t);
  return static_cast<std::size_t>(after - knots.begin()) - 1;
}

const SplinePatches::Patch& SplinePatches::patch(std::size_t i, std::size_t j) const {
  std::atomic<const Patch*>& place = patches_[i * directions_[1].spans.size() + j];
  const Patch* known = place.load(std::memory_order_acquire);
  if (known != nullptr) return *known;
  auto made = std::make_unique<const Patch>(make_patch(i, j));
  if (place.compare_exchange_strong(known, made.get(), std::memory_order_acq_rel)) known = made.release();
  return *known;
}

SplinePatches::Patch SplinePatches::make_patch(std::size_t i, std::size_t j) const {
  const Span &along_u = directions_[0].spans[i], &along_v = directions_[1].spans[j];
  const Eigen::Index rows = along_u.powers.rows(), columns = along_v.powers.rows();
  std::array<Eigen::MatrixXd, 4> poles;  // by coordinate: poles along v × poles along u
  for (Eigen::MatrixXd& of_coordinate : poles) of_coordinate.resize(columns, rows);
  for (int k = 0; k < rows; ++k)
    for (int l = 0; l < columns; ++l) {
      // Weight() gives 0 for a surface that is not rational, if it was periodic.
      const double w = is_rational_ ? surface_->Weight(along_u.first_pole + k, along_v.first_pole + l) : 1;
      const gp_XYZ x = surface_->Pole(along_u.first_pole + k, along_v.first_pole + l).XYZ();
      for (int c = 0; c < 3; ++c) poles[static_cast<std::size_t>(c)](l, k) = w * x.Coord(c + 1);
      poles[3](l, k) = w;
    }
  Patch patch{std::vector<Homogeneous>(static_cast<std::size_t>(rows * columns))};
  for (Eigen::Index c = 0; c < 4; ++c) {
    const Eigen::MatrixXd powers = along_v.powers * poles[static_cast<std::size_t>(c)] * along_u.powers.transpose();
    for (Eigen::Index k = 0; k < powers.size(); ++k) patch.coefficients[static_cast<std::size_t>(k)][c] = powers(k);
  }
  return patch;
}

geometry::SurfacePoint SplinePatches::at(double u, double v) const {
  const auto& [along_u, along_v] = directions_;
  u = along_u.into_period(u);
  v = along_v.into_period(v);
  const std::size_t i = along_u.find(u), j = along_v.find(v);
  const Homogeneous* coefficients = patch(i, j).coefficients.data();
  const double to_s = 1 / along_u.half_length(i), to_t = 1 / along_v.half_length(j);
  const double s = (u - along_u.middle(i)) * to_s, t = (v - along_v.middle(j)) * to_t;
  // By power of s: the derivatives by t.
  std::array<std::array<Homogeneous, 3>, kMostDegree + 1> rows;
  for (int a = 0; a <= along_u.degree; ++a, coefficients += along_v.degree + 1)
    rows[static_cast<std::size_t>(a)] =
        derivatives<Homogeneous>(along_v.degree, t, [&](int b) -> const Homogeneous& { return coefficients[b]; });
  const auto in_s = [&](std::size_t order) {
    return derivatives<Homogeneous>(
        along_u.degree, s, [&](int a) -> const Homogeneous& { return rows[static_cast<std::size_t>(a)][order]; });
  };
  const auto [A, A_s, A_ss] = in_s(0);
  const auto [A_t, A_st, unused] = in_s(1);
  const Homogeneous A_tt = in_s(2)[0];
  const auto point = [](const Homogeneous& of) { return of.head<3>(); };
  const double w = A[3];
  geometry::SurfacePoint p;
  p.x = point(A) / w;
  p.du = (point(A_s) - A_s[3] * p.x) / w;
  p.dv = (point(A_t) - A_t[3] * p.x) / w;
  p.duu = (point(A_ss) - 2 * A_s[3] * p.du - A_ss[3] * p.x) / w;
  p.duv = (point(A_st) - A_s[3] * p.dv - A_t[3] * p.du - A_st[3] * p.x) / w;
  p.dvv = (point(A_tt) - 2 * A_t[3] * p.dv - A_tt[3] * p.x) / w;
  p.du *= to_s;
  p.dv *= to_t;
  p.duu *= to_s * to_s;
  p.duv *= to_s * to_t;
  p.dvv *= to_t * to_t;
  return p;
}

std::shared_ptr<const SplinePatches> SharedPatches::of(const Handle(Geom_Surface) & surface) {
  const auto spline = Handle(Geom_BSplineSurface)::DownCast(surface);
  if (spline.IsNull()) return nullptr;
  const auto [place, is_new] = known_.try_emplace(surface.get());
  if (is_new) place->second = {spline, SplinePatches::make(spline)};
  return place->second.patches;
}

}  // namespace varimesh::cad
