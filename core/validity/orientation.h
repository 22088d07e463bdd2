// Which cells are numbered clockwise, and turning them over: cells that are joined across facets, in which sense they
// are numbered relative to each other, and the volume that their outer facets enclose. Internal to the library.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/bounding_box.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/ranks/ranks.h"

namespace varimesh::detail {

/// −1 if most straight-sided cells have a negative Jacobian at their centre and the curved cells have a negative volume
/// together, else 1. Flat cells count as positive: their sign is only rounding. Call it inside team.run().
/// @param ranks all of them have a part of the mesh
double orientation(const HighOrderMesh& mesh, const Team& team = Team(1), const Ranks& ranks = one_rank());

/// The centre of a box; 0 if it is empty.
std::array<double, 3> centre(const BoundingBox& box);

/// By cell, in the mesh's order: 1 if it is numbered clockwise (in space: left-handed). Empty if no cell is.
///
/// The geometry of a single cell does not tell: it may be inverted. Its neighbours across facets do, because two cells
/// of one sense list the vertices of their common facet in opposite order. So the cells that are joined across facets
/// fall into two classes. The volume that their outer facets enclose as the mesh has them, curved, is positive in one
/// sense and negative in the other; the cells of the other sense are clockwise. This volume does not depend on where
/// inner nodes are, so a tangled mesh is judged rightly. Cells that are joined in a way that allows no common sense (as
/// on a Möbius strip) are left as they are.
/// Call it inside team.run(). `facets`: those of the mesh.
std::vector<char> clockwise_cells(const HighOrderMesh& mesh, const Facets& facets, const Team& team = Team(1));

/// Turns over the cells that have a 1 in `which` (by cell, in the mesh's order): reference::turned_nodes(). To turn
/// twice gives the mesh back. Call it inside team.run().
void turn_cells(HighOrderMesh& mesh, std::span<const char> which, const Team& team = Team(1));

/// The element numbers of the cells that have a 1 in `which`.
std::vector<std::int64_t> cell_numbers(const HighOrderMesh& mesh, std::span<const char> which);

/// A mesh without clockwise cells: the mesh itself, or a copy in which they are turned. The mesh must outlive it.
class OrientedMesh {
 public:
  /// Call it inside team.run(). `facets`: those of the mesh, if they are known.
  explicit OrientedMesh(const HighOrderMesh& mesh, const Team& team = Team(1), const Facets* facets = nullptr);

  const HighOrderMesh& mesh() const { return turned_ ? *turned_ : mesh_; }
  /// The element numbers of the cells that came clockwise.
  const std::vector<std::int64_t>& clockwise() const { return clockwise_; }

 private:
  const HighOrderMesh& mesh_;
  std::optional<HighOrderMesh> turned_;
  std::vector<std::int64_t> clockwise_;
};

// === What the above is made of ===========================================================================

/// By cell: the sign of det ∇χ_L at the centre of the straight-sided cell, −1 or 1, or 0 if the cell is flat there, so
/// that the sign is only rounding. Call it inside team.run().
std::vector<std::int8_t> centre_signs(const HighOrderMesh& mesh, const Team& team);

/// Whether all neighbours are numbered in one sense. Call it inside team.run().
bool all_agree(const Cells& cells, const Facets& facets, const Team& team);

struct JoinedCells {
  /// Cells that are joined with each other and with no others.
  struct Group {
    bool is_consistent = true;  ///< Whether they can all be numbered in one sense.
    bool is_upright = true;     ///< Whether all have one sense and a positive centre_signs().
  };
  std::vector<std::int32_t> group;  ///< By cell. Groups are numbered in the order of their first cells.
  std::vector<std::int8_t> sense;   ///< By cell: 1 if it has the sense of the group's first cell, else −1.
  std::vector<Group> groups;
};

/// @param signs centre_signs()
JoinedCells join_cells(const Cells& cells, const Facets& facets, std::span<const std::int8_t> signs);

/// One of a cell's facets.
struct CellFacet {
  std::int32_t cell = 0;
  int facet = 0;
};

/// What each facet contributes to the volume that facets enclose: ∫ x · n / d over the curved facet, by Gauss's
/// theorem, with places relative to `origin`. In the plane, ½ ∫ x dy − y dx. Call it inside team.run().
std::vector<double> facet_volumes(const HighOrderMesh& mesh, const Cells& cells, std::span<const CellFacet> facets,
                                  const std::array<double, 3>& origin, const Team& team);

}  // namespace varimesh::detail
