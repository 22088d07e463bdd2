// Which parameters lie on a face and not outside its boundary or in its holes. Internal to the plugin.
#pragma once

#include <BRepTopAdaptor_FClass2d.hxx>
#include <TopoDS_Face.hxx>
#include <array>
#include <atomic>
#include <gp_Pnt2d.hxx>
#include <mutex>
#include <optional>
#include <vector>

#include "core/geometry/geometry.h"
#include "core/opencascade/outline.h"

namespace varimesh::cad {

/// OpenCASCADE's classifier walks along the whole boundary of a face for each question. Polygons along the boundary
/// save nearly all of these walks. The classifier answers only for points that are nearer to the polygons than their
/// error and the tolerance of the face. The polygons are made after some questions, and are used only if they agree
/// with the classifier at samples. Faces with very many edges or wires, or with wires that touch or overlap, have none.
/// Threads may share a face.
class FaceInterior {
 public:
  /// @param u, v  the bounds of the face's parameters
  /// @param u_period, v_period  of the surface; 0: not periodic
  FaceInterior(const TopoDS_Face& face, const geometry::Range& u, const geometry::Range& v, double u_period,
               double v_period);

  /// Whether (u, v) lies on the face. Points on its boundary do. Periodic parameters may be any.
  bool contains(double u, double v) const;

  /// Whether the polygons are used. Another thread must not ask its first questions at the same time.
  bool has_outline() const { return outline_.has_value(); }

 private:
  using Point = Outline::Point;  ///< Here: parameters relative to the bounds of the face, from 0 to 1.

  /// Nothing if OpenCASCADE fails.
  std::optional<bool> ask(double u, double v) const;
  /// The answer of the outline, if it has one.
  std::optional<bool> look_up(const Outline& outline, Point at) const;
  /// Nothing if the face has none.
  std::optional<Outline> make_outline(const Point& band) const;
  /// A point has no answer within this distance of a side. Nothing if the tolerance is so large that many points would
  /// have none, or if the face goes more than once round its surface.
  std::optional<Point> band() const;
  /// The polygon of each edge, by wire; empty if one has none.
  std::vector<std::vector<std::vector<Point>>> polygons() const;
  /// Whether the outline agrees with the classifier all over the face and on both sides of some edges.
  bool agrees(const Outline& outline, const std::vector<Point>& on_boundary) const;
  Point relative(const gp_Pnt2d& parameters) const;

  TopoDS_Face face_;
  std::array<geometry::Range, 2> ranges_;
  std::array<double, 2> periods_;
  mutable std::mutex mutex_;  ///< The classifier has caches.
  mutable BRepTopAdaptor_FClass2d classifier_;
  mutable std::atomic<int> questions_ = 0;
  mutable std::once_flag made_;
  mutable std::optional<Outline> outline_;
  mutable Point band_{};
};

}  // namespace varimesh::cad
