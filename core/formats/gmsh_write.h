// What the writers of the two Gmsh versions share. Internal to core/formats.
#pragma once

#include "core/formats/formats.h"
#include "core/formats/buffered_output.h"

namespace varimesh::formats {

/// Writes MSH 2.2 or 4.1.
Expected<void> write_gmsh(const HighOrderMesh& mesh, Format format, const Sink& sink);

void write_body_22(const HighOrderMesh& mesh, Output& out);
void write_body_41(const HighOrderMesh& mesh, Format format, Output& out);

/// The section of that name that was read from that format, or null.
const ForeignSection* kept_section(const HighOrderMesh& mesh, Format format, std::string_view name);

/// Name of a format, as in all().
std::string_view format_name(Format format);

/// How elements and nodes are classified where a file must say so (MSH 4.1) and the mesh comes from one that does not.
struct Classification {
  std::vector<Entity> entities;          ///< The mesh's, and those that had to be made.
  std::vector<int> block_entity;         ///< Entity tag of each element block.
  std::vector<NodeBlock> node_blocks;    ///< Cover node_order.
  std::vector<std::int32_t> node_order;  ///< Nodes in the order of the blocks; empty: the mesh's own order.
};

/// Entities for every block (elements of one entity that are in different physical groups go to different entities,
/// since MSH 4.1 has groups by entity), and each node on the lowest-dimensional entity that has an element with it.
/// @param keep_entities whether entities that are not listed are known from a section that is handed back
Classification classify(const HighOrderMesh& mesh, bool keep_entities);

}  // namespace varimesh::formats
