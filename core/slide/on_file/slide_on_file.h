// Slides the boundary nodes of a mesh on the geometry of a CAD file (reads the file, associates, snaps, curves,
// slides), or on the mesh's own boundary.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/geometry_options.h"
#include "core/slide/slide_report.h"

namespace varimesh {
namespace geometry {
struct Geometry;
}  // namespace geometry

/// Moves boundary nodes of a 3-D mesh or of a mesh in a plane, or the nodes of a surface in space, as
/// core/slide/slide.h says, and returns sentences that say what matched, what moved and how far the boundary is from
/// the geometry. Inner nodes move only if `slide` is coupled. With an order, the mesh is of order 1 and becomes one of
/// this order before (core/curve/curve.h). The mesh is unchanged after an error. Errors: BadInput if the file cannot be
/// read, if nothing matches, or if the mesh has another order; BadOption if check() refuses the options, if a group
/// does not exist, or if OpenCASCADE is not installed. Throws Interrupted if the work is to stop; the mesh is then as
/// it came. Once a mesh has been curved, nothing is thrown: its nodes stay where curving has put them, and a sentence
/// says so.
Expected<std::vector<std::string>> slide_on_file(HighOrderMesh& mesh, const GeometryOptions& options);

/// By node: whether it belongs to an element of one of these physical groups, which GeometryOptions::fix names. Errors:
/// BadOption if the mesh has no elements of a group.
Expected<std::vector<bool>> nodes_of_groups(const HighOrderMesh& mesh, const std::vector<std::string>& names);

/// What came of a mesh and a geometry.
struct SlidOnGeometry {
  std::vector<std::string> sentences;
  SlideReport report;
  std::int64_t straight_elements = 0;  ///< CurveReport::straight, if the mesh was curved.
  bool in_plane = false;               ///< The mesh lies in a plane, and its nodes slide on curves.
  bool is_cut_short = false;           ///< The mesh was curved, but the work was to stop before its nodes had slid.
};

/// slide_on_file() on a geometry that has been read already, to the same bits. `options.file` is not looked at.
Expected<SlidOnGeometry> slide_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                        const geometry::Geometry& model);

/// slide_on_file() on the mesh's own boundary.
Expected<SlidOnGeometry> slide_on_boundary(HighOrderMesh& mesh, const GeometryOptions& options);

}  // namespace varimesh
