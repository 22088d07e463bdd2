// B-spline surfaces as polynomials between their knots. Internal to the plugin.
#pragma once

#include <Geom_BSplineSurface.hxx>
#include <Standard_Handle.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <vector>

#include "core/geometry/geometry.h"

namespace varimesh::cad {

/// OpenCASCADE finds a point of a B-spline surface from its knots each time, which takes about a microsecond. Here each
/// patch between knots becomes a polynomial when it is first needed:
///
///     A(s, t) = Σ c_ij s^i t^j,   S = (A_0, A_1, A_2) / A_3,
///
/// where s and t run from −1 to 1 over the patch, and A has the weights in it. A_3 is 1 on a surface that is not
/// rational. Threads may share it.
class SplinePatches {
 public:
  /// Null if the degree is so high that powers of s and t would lose digits, or if some points are not OpenCASCADE's.
  static std::unique_ptr<SplinePatches> make(const Handle(Geom_BSplineSurface) & surface);
  ~SplinePatches();
  SplinePatches(const SplinePatches&) = delete;
  SplinePatches& operator=(const SplinePatches&) = delete;

  /// Beyond its bounds the surface goes on as it does in OpenCASCADE: periodically, or as the last polynomial.
  geometry::SurfacePoint at(double u, double v) const;

 private:
  using Homogeneous = Eigen::Vector4d;
  /// The coefficients c_ij; j varies fastest.
  struct Patch {
    std::vector<Homogeneous> coefficients;
  };
  /// What the poles of a span contribute to the powers of s (or t): power × pole.
  struct Span {
    int first_pole = 0;  ///< From 1.
    Eigen::MatrixXd powers;
  };
  /// The spans along one parameter.
  struct Direction {
    std::vector<double> knots;  ///< Those within the bounds, different from each other, in ascending order.
    std::vector<Span> spans;
    double period = 0;  ///< 0: not periodic.
    int degree = 0;

    double into_period(double t) const;
    /// The span that has t, which is in the period.
    std::size_t find(double t) const;
    double middle(std::size_t span) const { return 0.5 * (knots[span] + knots[span + 1]); }
    double half_length(std::size_t span) const { return 0.5 * (knots[span + 1] - knots[span]); }
    /// @param all  the knots, each as often as its multiplicity
    void make_spans(const TColStd_Array1OfReal& all);
  };

  explicit SplinePatches(const Handle(Geom_BSplineSurface) & surface);
  bool agree_with(const Handle(Geom_BSplineSurface) & surface) const;
  const Patch& patch(std::size_t i, std::size_t j) const;
  Patch make_patch(std::size_t i, std::size_t j) const;

  Handle(Geom_BSplineSurface) surface_;  ///< Not periodic.
  bool is_rational_;
  std::array<Direction, 2> directions_;
  mutable std::vector<std::atomic<const Patch*>> patches_;  ///< v varies fastest; null until one is needed.
};

/// The patches of each surface once, for all faces that lie on it.
class SharedPatches {
 public:
  /// Null if the surface is no spline, or one without patches.
  std::shared_ptr<const SplinePatches> of(const Handle(Geom_Surface) & surface);

 private:
  struct Known {
    Handle(Geom_BSplineSurface) surface;  ///< So that no other one gets its address.
    std::shared_ptr<const SplinePatches> patches;
  };
  std::map<const Geom_Surface*, Known> known_;
};

}  // namespace varimesh::cad
