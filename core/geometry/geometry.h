// The geometry on which the boundary nodes of a mesh lie: vertices, curves and surfaces with parameters, and which
// bounds which. It knows no CAD program. analytic.h makes shapes from formulas, pieces.h from the elements of a mesh,
// and load.h reads CAD files.
// Internal to the library.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace varimesh::geometry {

/// A curve at a parameter t: the point and its first and second derivatives by t, in the geometry's unit of length.
struct CurvePoint {
  Eigen::Vector3d x, dt, dtt;
};

/// A surface at parameters (u, v): the point and its first and second derivatives.
struct SurfacePoint {
  Eigen::Vector3d x, du, dv, duu, duv, dvv;

  /// The unit vector along du × dv. At a pole of the parameters, where the sine of the angle between du and dv or the
  /// length of one of them vanishes, it is zero.
  Eigen::Vector3d normal() const {
    const Eigen::Vector3d n = du.cross(dv);
    const double longest = std::max(du.squaredNorm(), dv.squaredNorm());
    return n.norm() > 1e-10 * longest ? n.normalized() : Eigen::Vector3d::Zero();
  }
};

/// The foot of a point on a curve. `distance` is in the geometry's unit of length; it is infinite if none was found.
struct CurveFoot {
  double t = 0;
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double distance = 0;
};

struct SurfaceFoot {
  double u = 0, v = 0;
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double distance = 0;
};

/// How a surface whose parameters jump from piece to piece finds closest points: Newton's method in (u, v) would not
/// pass from one piece to the next.
class PieceSearch {
 public:
  virtual ~PieceSearch() = default;
  /// The foot near the parameters (u, v). It is never farther from `point` than they are.
  virtual SurfaceFoot closest_from(const Eigen::Vector3d& point, double u, double v) const = 0;
  virtual SurfaceFoot closest(const Eigen::Vector3d& point) const = 0;
  /// Whether a piece may be folded over, so that the way from a guess may end at the fold.
  virtual bool may_fold() const { return true; }
};

/// The parameters of a curve or one of the parameters of a surface: first ≤ t ≤ last. If `period` is positive, every t
/// is allowed, and t and t + period are the same point.
struct Range {
  double first = 0;
  double last = 1;
  double period = 0;  ///< 0: not periodic.
  /// How far beyond `first` and `last` the shape goes on. A mesh generator may put a node a little outside the boundary
  /// of its surface.
  double margin_before = 0;
  double margin_after = 0;

  double length() const { return last - first; }
  /// The nearest t at which the shape is defined. A periodic parameter stays as it is.
  double clamp(double t) const {
    return period > 0 ? t : std::fmin(std::fmax(t, first - margin_before), last + margin_after);
  }
};

/// The shape of a curve. Objects are immutable, so threads may share them.
class CurveShape {
 public:
  virtual ~CurveShape() = default;
  /// If the shape has no such point, some coordinate is not finite.
  virtual CurvePoint at(double t) const = 0;
  virtual Range range() const = 0;
  /// Into how many equal intervals to cut the range so that the curve turns by less than about a right angle in each.
  virtual int intervals() const { return 16; }
};

/// The shape of a surface. Objects are immutable, so threads may share them.
class SurfaceShape {
 public:
  virtual ~SurfaceShape() = default;
  /// If the shape has no such point, some coordinate is not finite.
  virtual SurfacePoint at(double u, double v) const = 0;
  virtual Range u_range() const = 0;
  virtual Range v_range() const = 0;
  /// The same as CurveShape::intervals(), for u and v.
  virtual std::array<int, 2> intervals() const { return {16, 16}; }
  /// The unit normal at (u, v), where the shape has the derivatives `at`; zero at a pole. A shape in pieces gives the
  /// side that the piece as a whole has, also where the piece is folded over.
  virtual Eigen::Vector3d normal(const SurfacePoint& at, double /*u*/, double /*v*/) const { return at.normal(); }
  /// If the surface consists of pieces, what finds closest points on it; otherwise null.
  virtual const PieceSearch* pieces() const { return nullptr; }
  /// Whether (u, v) lies on the surface and not outside its boundary or in one of its holes. Points on the boundary lie
  /// on the surface.
  virtual bool contains(double u, double v) const {
    const auto inside = [](const Range& range, double t) {
      const double margin = 1e-9 * range.length();
      return range.period > 0 || (t >= range.first - margin && t <= range.last + margin);
    };
    return inside(u_range(), u) && inside(v_range(), v);
  }
};

struct Vertex {
  int tag = 0;  ///< The number by which a mesh generator may refer to it.
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
};

struct Curve {
  int tag = 0;
  std::shared_ptr<const CurveShape> shape;
  std::vector<int> vertices;  ///< Indices of the vertices at its ends: none, one (closed) or two.
  std::vector<int> surfaces;  ///< Indices of the surfaces that it bounds. A seam bounds the same surface twice.
};

struct Surface {
  int tag = 0;
  std::shared_ptr<const SurfaceShape> shape;
  std::vector<int> curves;  ///< Indices of the curves that bound it. A seam appears once.
  std::string name{};       ///< In the CAD file, as plain text (as_plain_text()); empty: it has none.

  /// How messages call it: "5", or "5 'Fillet'" if it has a name.
  std::string number_text() const { return std::to_string(tag) + (name.empty() ? "" : " '" + name + "'"); }
  /// The same after the word "surface ".
  std::string text() const { return "surface " + number_text(); }
};

/// All entities of a model.
struct Geometry {
  std::vector<Vertex> vertices;
  std::vector<Curve> curves;
  std::vector<Surface> surfaces;
  /// Sentences about what was left out of the file (for example a curve without shape).
  std::vector<std::string> notes;
};

/// The diagonal of a box around points of all entities, in the geometry's unit of length.
double size(const Geometry& geometry);

/// The same geometry in another unit of length: every coordinate times `factor`. The shapes refer to the old ones. No
/// surface may consist of pieces.
Geometry scaled(const Geometry& geometry, double factor);

}  // namespace varimesh::geometry
