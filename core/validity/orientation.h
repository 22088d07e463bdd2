// Which cells are numbered clockwise, and turning them over. Internal to the library.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// −1 if most straight-sided cells have a negative Jacobian at their centre and the curved cells have a negative volume
/// together, else 1. Flat cells count as positive: their sign is only rounding. Call it inside team.run().
double orientation(const HighOrderMesh& mesh, const Team& team = Team(1));

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

}  // namespace varimesh::detail
