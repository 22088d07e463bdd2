// Classifies a mesh on elementary entities, for MSH 4.1. Internal to core/formats.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The entities on which the elements and nodes of a mesh are classified. MSH 4.1 files must contain them; other
/// formats lack them.
struct Classification {
  std::vector<Entity> entities;          ///< The mesh's entities, and those that had to be made.
  std::vector<int> block_entity;         ///< Entity tag of each element block.
  std::vector<NodeBlock> node_blocks;    ///< Ranges of node_order.
  std::vector<std::int32_t> node_order;  ///< Nodes in the order of node_blocks; empty: the mesh's own order.
};

/// Gives every block an entity, and classifies each node on the entity of lowest dimension that has an element with
/// this node. MSH 4.1 assigns physical groups to entities, so elements of one entity that are in different groups get
/// different entities.
/// @param keep_entities whether to keep the entities of the blocks even if they are not listed: a section that is
///                      written unchanged defines them
Classification classify_on_entities(const HighOrderMesh& mesh, bool keep_entities, const Team& team);

}  // namespace varimesh::formats
