// Blocks of serendipity elements (core/reference/serendipity.h). Meshes have them only between a file's reader, which
// leaves completing them to complete_elements(), and after as_serendipity() a file's writer.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// How many nodes each element of a block has. Serendipity elements have fewer than
/// reference::node_count().
std::size_t nodes_per_element(const ElementBlock& block);

/// Whether the elements of a block lack the nodes inside their faces and volume.
bool is_serendipity(const ElementBlock& block);

/// The mesh with serendipity elements in place of the complete ones of these shapes, for a writer. Nothing if an
/// element of these shapes is none: if a node inside its faces or volume is not where complete_elements() puts it.
std::optional<HighOrderMesh> as_serendipity(const HighOrderMesh& mesh, const std::vector<Shape>& shapes);

}  // namespace varimesh
