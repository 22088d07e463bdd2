// Plane meshes that were put into z = 0, and a geometry in space. Internal to the library.
#pragma once

#include "core/association/association.h"
#include "core/mesh/plane.h"

namespace varimesh {

/// As associate_in_plane(), for a mesh that Plane::flatten() has put into z = 0: the geometry of the association is
/// where the mesh is now. Call it inside team.run().
Expected<Association> associate_flattened(const HighOrderMesh& flat, const Plane& plane,
                                          const geometry::Geometry& geometry, const Team& team);

}  // namespace varimesh
