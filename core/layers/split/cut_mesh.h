// Builds the mesh whose edges are cut. Internal to core/layers.
#pragma once

#include "core/base/error.h"
#include "core/layers/split/layer_cuts.h"
#include "core/mesh/high_order_mesh.h"
#include "core/mesh/topology.h"

namespace varimesh::detail {

/// A mesh whose cells are cells of another mesh, or parts of them.
struct CutMesh {
  HighOrderMesh mesh;
  std::vector<std::int32_t> parents;  ///< By cell: the cell of the other mesh.
};

/// The mesh with all elements cut whose edges are. Counts in the report how many cells that is; `in_rows` are the cells
/// above the wall, sorted. Errors: BadInput if an element cannot be cut so, or if there would be too many nodes.
Expected<CutMesh> cut_mesh(const HighOrderMesh& mesh, const Topology& topology, const LayerCuts& cuts,
                           const std::vector<std::int32_t>& in_rows, LayerSplitReport& report);

}  // namespace varimesh::detail
