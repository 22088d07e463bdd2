// Which parameters lie on a face and not outside its boundary or in its holes. Internal to the plugin.
#pragma once

#include <BRepTopAdaptor_FClass2d.hxx>
#include <Geom2d_Curve.hxx>
#include <TopoDS_Face.hxx>
#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "core/geometry/geometry.h"

namespace varimesh::cad {

/// OpenCASCADE's classifier walks along the whole boundary of a face for each question. A grid over the face's
/// parameters saves most of these walks: in a cell that the boundary does not come near, all points have the answer of
/// the cell's middle. Near the boundary the classifier answers. The grid is made after some hundred questions.
/// Threads may share a face.
class FaceInterior {
 public:
  /// @param u, v  the bounds of the face's parameters
  /// @param u_period, v_period  of the surface; 0: not periodic
  FaceInterior(const TopoDS_Face& face, const geometry::Range& u, const geometry::Range& v, double u_period,
               double v_period);

  /// Whether (u, v) lies on the face. Points on its boundary do. Periodic parameters may be any.
  bool contains(double u, double v) const;

 private:
  enum State : std::uint8_t { Unknown, Near, Inside, Outside };  ///< Near: to the boundary.

  /// Nothing if OpenCASCADE fails.
  std::optional<bool> ask(double u, double v) const;
  void make_grid() const;
  /// Returns false if the tolerance of the boundary is too large for a grid, or the face goes more than once round.
  bool set_margins() const;
  /// Returns false if the curve's points cannot be computed or lie outside of the bounds.
  bool mark(const Handle(Geom2d_Curve) & curve, double first, double last) const;
  bool mark_around(const gp_Pnt2d& point) const;
  /// Where a parameter lies, in cells; negative if it is not in the face's bounds.
  std::int32_t place(int direction, double parameter) const;

  TopoDS_Face face_;
  std::array<geometry::Range, 2> ranges_;
  std::array<double, 2> periods_;
  mutable std::array<std::int32_t, 2> margins_{};  ///< How many cells around a point of the boundary are near to it.
  mutable std::mutex mutex_;                       ///< The classifier has caches.
  mutable BRepTopAdaptor_FClass2d classifier_;
  mutable std::atomic<int> questions_ = 0;
  mutable std::once_flag made_;
  mutable std::vector<std::atomic<std::uint8_t>> states_;  ///< By cell, u first; empty if there is no grid.
};

}  // namespace varimesh::cad
