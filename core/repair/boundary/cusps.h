// Where a model leaves no room for valid elements.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/association/association.h"
#include "core/mesh/high_order_mesh.h"
#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// Two sides of the boundary that meet at nearly 0° inside the body: two surfaces along their curve, or two curves in
/// the corner of a surface. The Jacobian of every element there vanishes, or nearly, however its nodes move and however
/// small it is.
struct Cusp {
  double angle = 0;                             ///< Between the sides, in degrees, where it is smallest,
  Eigen::Vector3d x = Eigen::Vector3d::Zero();  ///< and where that is.
  std::string sides;                            ///< "surfaces 2 and 8 'Hole'", or "curves 4 and 7 of surface 2 'Lid'".
  std::set<std::int64_t> cells;                 ///< Numbers of the wanted cells that touch it.
};

/// The largest angle of a cusp, in degrees. The Jacobian of a tetrahedron whose edges have length 1 is at most the sine
/// of its angle at an edge: .09 at 5°, which curved sides soon use up. Sides that are meant to touch, but come with an
/// error of some degrees, are found too.
inline constexpr double kMostAtCusp = 5;
/// Up to this angle, in degrees, a cusp leaves no room: the sine is less than threshold::kWeak.
inline constexpr double kNoRoom = 1;

/// The cusps at which wanted cells have a vertex, by the tangents and normals of the geometry at nodes of the mesh, and
/// each pair of sides once. Only tetrahedra are looked at.
/// @param wanted  numbers of cells, in ascending order
std::vector<Cusp> cusps(const HighOrderMesh& mesh, Association& association, std::span<const std::int64_t> wanted);

/// The most bytes that cusps() has in use, with the association of the mesh, if all cells are wanted.
std::int64_t bytes_of_cusps(const MeshCounts& counts);

/// A sentence for a person: where the cusps are, how many elements touch them, and what to do. Empty without cusps.
std::string cusps_sentence(const std::vector<Cusp>& cusps);

}  // namespace varimesh
