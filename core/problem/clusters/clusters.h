// Clusters of a few hundred cells that are near each other: a sweep works on one while its data are in cache.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// All cells of dimension mesh.dimension, cluster by cluster. A cell is given by its number in the mesh's order.
struct Clusters {
  std::vector<std::int32_t> cells;
  std::vector<std::int32_t> begin;  ///< clusters + 1: where each cluster begins in `cells`.
};

/// Grows clusters of `size` cells from cell to cell over common vertices. Each cluster starts where the last one
/// stopped. The clusters depend only on the topology and the numbering, not on the coordinates: a rotated mesh is swept
/// in the same order.
///
/// A cell's turn depends on all before it. So that threads can share the work, a large mesh is divided into regions of
/// 64 clusters and at least 4,096 cells (regions.h), whose clusters grow independently. The last cluster of each region
/// may be smaller. The result does not depend on the number of threads. Call it inside team.run().
Clusters cluster_cells(const HighOrderMesh& mesh, std::int32_t size, const Team& team = Team(1));

}  // namespace varimesh
