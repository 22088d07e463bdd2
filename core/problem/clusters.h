// Cells that are near each other, a few hundred at a time: what a sweep works on while their data are in cache.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// All cells of dimension mesh.dimension, by their number in the mesh's order, cluster by cluster.
struct Clusters {
  std::vector<std::int32_t> cells;
  std::vector<std::int32_t> begin;  ///< Where each cluster begins in `cells`; one more than there are clusters.
};

/// Grows clusters of `size` cells from cell to cell over common vertices, each from where the last one stopped. They
/// depend on topology and numbering alone, not on coordinates: a mesh that is turned is swept in the same order.
Clusters cluster_cells(const HighOrderMesh& mesh, std::int32_t size);

}  // namespace varimesh
