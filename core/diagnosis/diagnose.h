// How what no movement of free nodes can repair is found.
#pragma once

#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"

namespace varimesh {

/// Names them. `fixed` says for every node of the mesh whether it is held (fixed_nodes() of core/mesh/connectivity.h,
/// less those freed by name). Call it inside team.run(); the result is in the order of kinds, then of the mesh, and
/// does not depend on the number of threads.
///
/// - Point condition: at a point of a cell where J depends on fixed nodes only, it has to be positive.
/// - Vertex condition (3-D): at a fixed vertex v, every mesh edge is a direction, its tangent at v, and every cell a
///   spherical triangle of directions. Triangles are joined where they share a side with a free end. A piece fenced by
///   fixed directions fills a solid angle that no free node can change but by whole spheres: for three b, c, d it is Ω
///   of the spherical triangle where det(b, c, d) > 0, 4π − Ω where it is negative, with tan(Ω/2) = det / (1 + b·c +
///   c·d + d·b) (A. van Oosterom, J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983);
///   for more the sum of the inner angles less (n − 2)π. Pieces of no angle are named. The boundary faces at v leave
///   Ω_v = Σ dihedral angles − (n − 2)π, or 4π inside; where the pieces claim more than that, one that is turned inside
///   out claims 4π less: named are those that are turned least until the rest fits. So the sum decides and not the
///   determinant's sign: at the corner of a cavity a negative one is right.
/// - Fans: where all edges of a corner at v but one, with direction x, are fixed, its determinant is n · x > 0 with n
///   known. The corners that share x want it in one half-space each; where the half-spaces have nothing in common, the
///   corners are named.
/// - Folded faces: a flat face whose normal changes sign has points with no normal at all, where J = 0.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team);

}  // namespace varimesh
