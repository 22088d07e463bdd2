// Grows a thick layer on walls that have none.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>

#include "core/base/team.h"
#include "core/layers/thickness_shares.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh {

struct Association;

/// A mesh with a row of thick cells on its walls.
struct GrownLayer {
  HighOrderMesh mesh;
  std::array<double, 2> thickness{};  ///< The smallest and the largest thickness, in the mesh's unit of length.
  /// The share of the walls' area on which the thickness is within 5 % of what was asked for.
  double full_share = 0;
  std::string sentence;    ///< For humans: how thick it is, and where it is thinnest.
  ThicknessShares shares;  ///< At each vertex of the walls.
};

/// Puts a row of quadrilaterals, prisms or hexahedra on the boundary elements of the walls, along directions that see
/// all elements around a vertex of the wall best. Its thickness is measured along the normals of the wall; at convex
/// edges and in concave corners the sides of its cells are up to ten times as long. The rest of the mesh moves away as
/// a linear elastic body in which small cells are stiff. Where the wall ends at another boundary, the row follows it,
/// and its nodes move on it: in a plane, or on the shape that the model has there, or else the mesh as it came.
///
/// The row gets thinner where columns would cross, where cells beyond it would be crushed, and where a cell of it would
/// not be certified valid, or a cell that was certified valid would no longer be.
///
/// The nodes of the walls stay, bit for bit. The mesh stays conforming, and keeps groups, numbers of elements and
/// periodic pairs. New elements and nodes come last. The result does not depend on the number of threads.
///
/// If the time limit of the team's token passes, the layer is made once more, so thin that no cell has to move away. If
/// that is not possible, or the token says for another reason that the work is to stop, this throws Interrupted. Do not
/// call it inside team.run(). Errors: BadOption and BadInput for walls that do not exist, or on which no layer can
/// grow.
/// @param walls      as LayerOptions::walls
/// @param thickness  in the mesh's unit of length
/// @param model      the mesh with the CAD model that it was made from: the normals of the walls, and the shape of
///                   curved boundaries at which they end, are those of the model. Null: there is none
/// @param asked      whether somebody asks for the end, as the team's token does; after the time limit only this
///                   counts. May be empty
Expected<GrownLayer> grow_layer(const CheckedMesh& mesh, std::span<const std::string> walls, double thickness,
                                const Team& team, const Association* model = nullptr,
                                const std::function<bool()>& asked = {});

}  // namespace varimesh
