// How the diagnosis finds what no movement of free nodes can repair.
#pragma once

#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"

namespace varimesh {

/// Finds them. `fixed` says for every node of the mesh whether it is fixed (fixed_nodes() of core/mesh/connectivity.h,
/// without those that the user freed). Call it inside team.run(). The result is in the order of kinds, then of the
/// mesh, and does not depend on the number of threads.
///
/// - Point condition: at a point of a cell where J depends on fixed nodes only, it must be positive.
/// - Vertex condition (3-D): at a fixed vertex v, every mesh edge is a direction, its tangent at v, and every cell is a
///   spherical triangle of directions. Triangles that share a side with a free end are joined to one piece. A piece
///   that fixed directions enclose fills a solid angle that free nodes can change only by whole spheres. For three
///   directions b, c, d it is Ω of the spherical triangle if det(b, c, d) > 0, and 4π − Ω if the determinant is
///   negative, with tan(Ω/2) = det / (1 + b·c + c·d + d·b) (A. van Oosterom, J. Strackee, The solid angle of a plane
///   triangle, IEEE Trans. Biomed. Eng. 30, 1983). For more directions it is the sum of the inner angles minus (n −
///   2)π. Pieces whose angle is zero are reported. The boundary faces at v leave Ω_v = Σ dihedral angles − (n − 2)π, or
///   4π if v is inside. If the pieces claim more than that, some are turned inside out, and each of these claims 4π
///   less. The diagnosis reports the pieces that need the least turning until the rest fits. So the sum decides, not
///   the sign of a determinant: at the corner of a cavity a negative determinant is right.
/// - Fans: if all edges of a corner at v are fixed except one with direction x, its determinant is n · x with a known n
///   and must be positive. Each of the corners that share x restricts it to a half-space. If the half-spaces have
///   nothing in common, the corners are reported.
/// - Folded faces: a flat face whose normal changes sign has points without a normal, where J = 0. A curved triangle
///   whose normals turn by more than 90° counts too, if no derivative into the element that a polynomial can have stays
///   well on its side (fixed_samples.h).
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team);

/// diagnose() of core/diagnosis/diagnosis.h with the team's threads. Do not call it inside team.run(). The team's token
/// may interrupt it.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const Team& team);

}  // namespace varimesh
