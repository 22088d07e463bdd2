#include "core/solvers/sweeps/sweep_memory.h"

#include "core/kernels/kernels.h"

namespace varimesh {
namespace {

constexpr std::int64_t kInt = sizeof(std::int32_t), kDouble = sizeof(double);

}  // namespace

std::int64_t bytes_of_colouring(const MeshCounts& counts) { return kInt * counts.free_nodes(); }

std::int64_t bytes_of_making_colouring(const MeshCounts& counts) {
  const Places& free = counts.free;
  const std::int64_t places = free.vertices + free.edges + free.triangles + free.quadrilaterals + counts.cell_count();
  // The nodes place by place and cluster by cluster; the places, their clusters and their order; the cells of each
  // group, which are about twice as many as there are, the groups of each cell, and the colours that a cell has.
  return kInt * (2 * counts.free_nodes() + 3 * places + 7 * counts.cell_count());
}

std::int64_t bytes_of_sweeper(const MeshCounts& counts) {
  return counts.cell_count() * (static_cast<std::int64_t>(sizeof(CellScan)) + 2 + 2 * kDouble);
}

std::int64_t bytes_of_first_sweep(const MeshCounts& counts) { return 4 * kDouble * counts.free_nodes(); }

}  // namespace varimesh
