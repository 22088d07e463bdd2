// Moves the boundary nodes of a straight mesh to the curved boundary. The boundary is given as displacements of nodes
// or as a mesh of its own.
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
  std::int64_t number = 0;  ///< The node's number in the file of the mesh.
  std::array<double, 3> by{};
};

/// Reads displacements from text: one line "number dx dy dz" per node, separated by blanks. If `dimension` is 2, dz may
/// be left out and is 0. Blank lines and comments after # are ignored. Errors: BadInput, which names the line, also if
/// there are no displacements.
Expected<std::vector<NodeDisplacement>> read_displacements(std::string_view text, int dimension);

/// Moves boundary nodes: nodes on facets with one neighbour and on elements of one dimension less. The other boundary
/// nodes stay. Errors: BadInput if a node is not in the mesh, is not on the boundary, is named twice, has a
/// displacement that is not finite, or would leave the plane of a 2-D mesh. The mesh is unchanged after an error.
Expected<void> displace_boundary(HighOrderMesh& mesh, std::span<const NodeDisplacement> displacements);

/// Moves boundary nodes to the positions of the nodes of `boundary` that have the same numbers. `boundary` is a mesh of
/// the whole boundary or of a part of it, with the same order and node numbers as `mesh`. Nodes without elements are
/// ignored. Errors: BadInput if a node is not in the mesh, is not on the boundary or has a coordinate that is not
/// finite, or if there are no elements. The mesh is unchanged after an error.
Expected<void> replace_boundary(HighOrderMesh& mesh, const HighOrderMesh& boundary);

}  // namespace varimesh
