// Faces and edges that touching bodies repeat. Internal to core/association.
#pragma once

#include <array>
#include <vector>

#include "core/base/team.h"
#include "core/geometry/geometry.h"

namespace varimesh::detail {

/// What was found by merge_repeated().
struct Repeated {
  int surfaces = 0;  ///< How many surfaces were left out, because an earlier one is the same.
  /// For each surface that is left: the larger surfaces that contain it.
  std::vector<std::vector<int>> part_of;
};

/// Each body of a STEP file has its own faces, so a face at which two bodies touch is there twice. A mesh has it once.
/// This leaves out surfaces and curves that lie on an earlier one as a whole, and this one on them. What they bounded,
/// the earlier one bounds. If a curve or surface is only a part of another, both stay; then the longer curve bounds
/// what its part bounds too, and the larger surface is bounded by the curves of its part.
/// @param tolerance  how far apart points of the same surface may be, in the geometry's unit of length
/// The result does not depend on the number of threads. Call it inside team.run().
Repeated merge_repeated(geometry::Geometry& geometry, double tolerance, const Team& team);

/// A point on several surfaces. No curve bounds all of them, and no vertex lies there.
struct CommonPoint {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  std::vector<int> surfaces;                ///< Indices.
  std::vector<std::array<double, 2>> feet;  ///< Parameters of the point on each of them.
};

/// Faces of touching bodies may overlap, and neither is a part of the other. Then a curve around one face runs through
/// the other, and curves of two bodies cross where neither has a vertex. At each point: if a curve through the point
/// lies in a surface of the point, on at least one side of the point, the curve becomes a boundary of this surface.
/// Where curves cross, a vertex is added. Returns how much was added.
/// @param tolerance  as for merge_repeated()
int complete_at(geometry::Geometry& geometry, const std::vector<CommonPoint>& points, double tolerance);

}  // namespace varimesh::detail
