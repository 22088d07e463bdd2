// Slides the boundary nodes of a mesh on the geometry of a CAD file (reads the file, associates, snaps, curves,
// slides), or on the mesh's own boundary.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/stop_token.h"
#include "core/mesh/high_order_mesh.h"
#include "core/slide/slide_report.h"

namespace varimesh {
namespace geometry {
struct Geometry;
}  // namespace geometry

struct GeometryOptions {
  std::string file;          ///< A STEP, IGES or BREP file; empty: none.
  bool on_boundary = false;  ///< Without a file: nodes slide on the mesh's own curved boundary as it came.
  int order = 0;             ///< 0: the mesh is curved. Otherwise it is of order 1 and is first curved with this order.
  /// Which nodes slide: none, surfaces, all (curves and surfaces) or coupled (the same, and then all nodes of the mesh
  /// together); empty: all.
  std::string slide;
  /// With `slide` coupled: how far the boundary may lie from the geometry, in the mesh's unit of length. 0: twice as
  /// far as it does.
  double tolerance = 0;
  /// With `slide` coupled: for how long all nodes may move together, in seconds. 0: no limit.
  double coupled_seconds = 0;
  bool snap = false;  ///< First move nodes that are off their curve, surface or vertex onto it.
  /// A node is off if it is farther than this from its entity, relative to the diagonal of the boundary's box.
  double snap_tolerance = 1e-6;
  /// Nodes cross joints at which surfaces or curves meet at no more than this angle, in degrees; 0: none.
  double smooth_angle = 0;
  std::vector<std::string> fix;     ///< Physical groups whose nodes stay, by name, by tag, or by "dimension:tag".
  int threads = 1;                  ///< 0: as many as the machine has.
  const StopToken* stop = nullptr;  ///< May stop slide_on_model() if the order is 0; may be null.

  bool any() const { return on_boundary || !file.empty(); }
};

/// Moves boundary nodes of a 3-D mesh of order 2 or more, or the nodes of a surface in space, as core/slide/slide.h
/// says, and returns sentences that say what matched, what moved and how far the boundary is from the geometry. Inner
/// nodes move only if `slide` is coupled. With an order, the mesh is of order 1 and becomes one of this order before
/// (core/curve/curve.h). The mesh is unchanged after an error. Errors: BadInput if the file cannot be read, if nothing
/// matches, or if the mesh lies in a plane or has another order; BadOption if `slide` is no such word, if there is a
/// file and `on_boundary`, if `on_boundary` comes with an order or `snap`, if the order is not 0 or 2 to kMaxOrder, if
/// a group does not exist, or if OpenCASCADE is not installed.
Expected<std::vector<std::string>> slide_on_file(HighOrderMesh& mesh, const GeometryOptions& options);

/// What came of a mesh and a geometry.
struct SlidOnGeometry {
  std::vector<std::string> sentences;
  SlideReport report;
};

/// slide_on_file() on a geometry that has been read already, to the same bits. `options.file` is not looked at. Throws
/// Interrupted if the work is to stop; the mesh is then as it came.
Expected<SlidOnGeometry> slide_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                        const geometry::Geometry& model);

}  // namespace varimesh
