// A straight mesh and where its boundary really lies: displacements of boundary nodes, or the curved boundary alone.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// How far a node is moved, in the mesh's own unit of length.
struct NodeDisplacement {
  std::int64_t number = 0;  ///< The node's number as the mesh's file has it.
  std::array<double, 3> by{};
};

/// Reads displacements from text: a line "number dx dy dz" a node (of a mesh of `dimension` 2 dz may be left out: 0),
/// separated by blanks; empty lines and what follows a # are passed over. Errors: BadInput with the line, or where no
/// line has a displacement.
Expected<std::vector<NodeDisplacement>> read_displacements(std::string_view text, int dimension);

/// Moves boundary nodes: those on facets with one neighbour and on elements of one dimension less. Boundary nodes that
/// are not named stay. Errors: BadInput for a node that the mesh does not have, that is inside, that comes twice, whose
/// displacement is not finite, or that would leave the plane of a 2-D mesh; the mesh is then as it was.
Expected<void> displace_boundary(HighOrderMesh& mesh, std::span<const NodeDisplacement> displacements);

/// Puts boundary nodes where `boundary` has the nodes of the same numbers. `boundary` is a mesh of the boundary alone
/// (or of part of it: the rest stays), numbered and of the order as here; nodes that none of its elements has do not
/// count. Errors: BadInput as above.
Expected<void> replace_boundary(HighOrderMesh& mesh, const HighOrderMesh& boundary);

}  // namespace varimesh
