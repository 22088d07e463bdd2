// Plane meshes and the curves of a geometry that lie in their plane: a profile. Internal to the library.
#pragma once

#include <string>
#include <vector>

#include "core/association/association.h"

namespace varimesh {

/// Associates a mesh that lies in a plane with the curves of the geometry that lie there, whether they bound faces or
/// not. The only surface of Association::geometry is the plane, on which all elements lie; Association::in_plane is
/// set, and the size is the size of the mesh or of the curves, whichever is smaller, because a far field may be much
/// larger than the profile inside.
///
/// A node on the border of the mesh belongs to the vertex at its place, or else to the nearest curve within
/// kMatchTolerance. Where regions of the mesh meet, nodes belong to a curve only if they lie on it, within 10⁻⁶ of the
/// size. Nodes of the border that are near no curve belong to nothing, and all other nodes to the plane. Parameters of
/// the file are not looked at.
///
/// If the mesh and the curves differ in size by a usual factor between units, the geometry is scaled, provided that
/// more edges of the border match than if it is not. Errors: BadInput if no curve lies in the plane, or if no edge of
/// the border lies on a curve. The result does not depend on the number of threads. Call it inside team.run().
Expected<Association> associate_in_plane(const HighOrderMesh& mesh, const geometry::Geometry& geometry,
                                         const Team& team);

/// As describe(), of associate_in_plane().
std::vector<std::string> describe_in_plane(const HighOrderMesh& mesh, const Association& association, double tolerance);

}  // namespace varimesh
