// Curves and surfaces that meet smoothly, as one. Internal to the library.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "core/geometry/geometry.h"

namespace varimesh::geometry {

/// A surface that takes part in a joint.
struct SurfacePart {
  std::shared_ptr<const SurfaceShape> shape;
  double sign = 1;  ///< −1: its normal is turned, so that it agrees with those of the other parts.
  std::vector<std::size_t> neighbours;  ///< Parts that it meets smoothly.
};

/// The parameters of part k are u = 4 k + s − ½ and v = t, where s and t run from 0 to 1 over the part's own ranges and
/// go on beyond them as the part does. It contains what one of the parts contains. The foot of a point from a guess is
/// on the guess's part if that part contains it, and otherwise on a neighbour that contains its foot there.
std::shared_ptr<const SurfaceShape> join(std::vector<SurfacePart> parts);

/// The parameters on a joined surface of a point with the parameters `at` on part k, whose shape is `part`.
std::array<double, 2> parameters_on_joined(const SurfaceShape& part, std::size_t k, const std::array<double, 2>& at);

/// A curve that takes part in a joint.
struct CurvePart {
  std::shared_ptr<const CurveShape> shape;
  bool backwards = false;  ///< It is passed through from its last parameter to its first.
};

/// Curves, each of which begins where the one before ends. The parameter runs over each part by its length.
class JoinedCurve : public CurveShape {
 public:
  JoinedCurve(std::vector<CurvePart> parts, bool closed);

  CurvePoint at(double t) const override;
  Range range() const override { return {0, begins_.back(), closed_ ? begins_.back() : 0}; }
  int intervals() const override;
  /// The parameter of a point with the parameter t on part k.
  double parameter(std::size_t k, double t) const;

 private:
  std::vector<CurvePart> parts_;
  std::vector<double> begins_;  ///< By part, and the end of the last one.
  bool closed_;
};

}  // namespace varimesh::geometry
