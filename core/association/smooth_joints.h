// Surfaces and curves of a geometry that meet smoothly become one, so that nodes can cross their joints. Internal to
// the library.
#pragma once

#include <string>

#include "core/association/association.h"

namespace varimesh {

/// What was joined.
struct SmoothJoints {
  int joined_surfaces = 0;  ///< Surfaces that are part of another now.
  int joined_curves = 0;    ///< Curves that are part of another now.
  int free_curves = 0;      ///< Joints of surfaces: their nodes may leave them.
  int free_vertices = 0;    ///< Vertices whose node may leave them.

  /// A sentence for a person.
  std::string sentence() const;
};

/// Joins what meets smoothly, and puts the nodes of the joints on what they joined:
/// - Two surfaces that a curve separates become one if their normals differ by at most `angle` (radians) at every
///   node of the mesh on this curve, and if one surface goes on where the other ends. So a cusp, at which both lie on
///   the same side, is no joint. Neither is a curve between different physical groups of the mesh, whose border would
///   move.
/// - A vertex at which no other curve ends than such joints becomes a point of the surface.
/// - Two curves become one at a vertex at which no other curve ends than joints, if their tangents differ by at most
///   `angle` and they bound the same surfaces.
/// Elements keep the entity of the file, so an element may reach beyond its surface in the file afterwards. The mesh
/// has order 2 or more.
SmoothJoints join_smoothly(const HighOrderMesh& mesh, Association& association, double angle);

}  // namespace varimesh
