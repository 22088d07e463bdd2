#include "core/solvers/newton/newton_memory.h"

#include <algorithm>

#include "core/base/aligned.h"
#include "core/base/index.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/preconditioner/multigrid/multigrid.h"
#include "core/preconditioner/stretched_cells.h"
#include "core/reference/mirrors.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

constexpr std::int64_t kFloat = sizeof(float), kDouble = sizeof(double), kInt = sizeof(std::int32_t),
                       kLong = sizeof(std::int64_t);

/// Cells of a set, the lanes past the last one included.
std::int64_t lanes(const SetSizes& set) { return (set.count + kBatch - 1) / kBatch * kBatch; }

/// Order of the coarse level.
int coarse_order(const MeshCounts& counts) { return std::min(counts.order, 2); }

struct CoarseSizes {
  std::int64_t nodes = 0, incidences = 0;
  std::int64_t in_cells = 0;  ///< Fixed nodes included.
  std::int64_t blocks = 0;    ///< Of the matrix, without the diagonal.
};

CoarseSizes coarse_sizes(const MeshCounts& counts, int order) {
  CoarseSizes sizes{counts.free.nodes(order), counts.free_in_cells.nodes(order), 0, counts.neighbours[at(order)]};
  for (std::size_t s = 0; s < kShapes; ++s)
    if (counts.cells[s] > 0) sizes.in_cells += counts.cells[s] * reference::node_count(static_cast<Shape>(s), order);
  return sizes;
}

std::int64_t bytes_of_linear_level(const MeshCounts& counts) {
  const std::int64_t d = counts.dimension;
  const CoarseSizes level = coarse_sizes(counts, 1);
  std::int64_t bytes = kInt * level.in_cells + 2 * kDouble * d * level.nodes;  // nodes of the cells, right, solution
  bytes += kLong * level.nodes + static_cast<std::int64_t>(sizeof(Incidence)) * level.incidences;  // cells
  bytes += kLong * level.nodes + (kInt + kDouble) * (level.nodes + level.blocks);                  // the matrix
  if (level.nodes == 0) return bytes;
  // Values at the nodes above, and the transpose.
  const Places& free = counts.free;
  std::int64_t values = free.vertices;
  if (coarse_order(counts) == 2) {
    values += 2 * free.edges + 4 * (free.quadrilaterals + free.cells[at(static_cast<int>(Shape::Quadrilateral))]) +
              8 * free.cells[at(static_cast<int>(Shape::Hexahedron))];
  }
  bytes += 2 * (kInt + kFloat) * values + kLong * (counts.free.nodes(coarse_order(counts)) + level.nodes);
  return bytes + Multigrid::bytes_needed(level.nodes, level.blocks, counts.dimension);
}

std::int64_t bytes_of_coarse_level(const MeshCounts& counts) {
  const std::int64_t d = counts.dimension;
  const CoarseSizes level = coarse_sizes(counts, coarse_order(counts));
  std::int64_t bytes = kInt * level.in_cells + kFloat * tensor_size(counts.dimension) * counts.cell_count();
  bytes += 2 * kLong * level.nodes;  // where incidences and rows begin
  bytes += static_cast<std::int64_t>(sizeof(Incidence)) * level.incidences;
  bytes += (kInt + std::int64_t{sizeof(std::int16_t)} * d * d) * level.blocks;
  bytes += kFloat * (d * d + 3 * padded(counts.dimension)) * level.nodes;  // inverse factors, vectors
  return bytes + bytes_of_linear_level(counts);
}

/// As many stretched cells as a mesh may have, each in a group of its own.
std::int64_t bytes_of_stretched_cells(const MeshCounts& counts, const std::vector<SetSizes>& sets) {
  std::int64_t bytes = kFloat * counts.cell_count(), largest = 0;
  for (const SetSizes& set : sets) {
    if (set.nodes > StretchedCells::kMostCellNodes) return 0;
    const std::int64_t rows = std::int64_t{set.dimension} * set.nodes;
    bytes += kFloat * rows * rows;
    largest = std::max(largest, kFloat * rows * (rows + 1) / 2);
  }
  return bytes + counts.cell_count() / StretchedCells::kCellsPerStretched * largest;
}

/// Vectors by free node: gradient, step, residual, direction, product, inverse blocks; and the scans.
std::int64_t bytes_of_vectors(const MeshCounts& counts) {
  const std::int64_t d = counts.dimension;
  return counts.free_nodes() * (2 * kDouble * d + 3 * kFloat * d + kFloat * d * (d + 1) / 2) +
         static_cast<std::int64_t>(sizeof(CellScan)) * counts.cell_count();
}

}  // namespace

std::int64_t bytes_of_batches(const SetSizes& set, const NewtonSizes& sizes) {
  const std::int64_t d = set.dimension, square = d * d;
  std::int64_t of_cell = kFloat * set.nodes * 2 * d + kInt * set.nodes;                // contributions, ranks
  of_cell += set.points * (kFloat * sizes.hessian_entries + 2 * square);               // the linearisation
  of_cell += kFloat * (square + 1) + kFloat * square * (set.affine ? 1 : set.points);  // mean, inverse_target
  of_cell += (sizes.has_left_factor ? kFloat * square : 0) + (sizes.has_norm ? kFloat * set.nodes * d : 0);
  const std::int64_t mirrors = std::int64_t{1} << reference::mirrors(set.shape).count;
  const std::int64_t table = kFloat * set.points * set.nodes;
  return lanes(set) * of_cell + table * (d * (d + 1) / 2 + 2 * d / mirrors);  // squares, the folded gradient
}

std::int64_t bytes_of_newton(const MeshCounts& counts, const std::vector<SetSizes>& sets, const NewtonSizes& sizes) {
  std::int64_t bytes =
      bytes_of_coarse_level(counts) + bytes_of_vectors(counts) + bytes_of_stretched_cells(counts, sets);
  for (const SetSizes& set : sets) bytes += bytes_of_batches(set, sizes);
  return bytes;
}

std::int64_t bytes_of_newton_set_up(const MeshCounts& counts, const std::vector<SetSizes>& sets,
                                    const NewtonSizes& sizes) {
  std::int64_t bytes = 0;
  for (const SetSizes& set : sets) bytes += bytes_of_batches(set, sizes);
  // The numbers of the coarse nodes by mesh node, then the cells, the colour and the place of each coarse node, and the
  // colours that a cell has.
  const CoarseSizes level = coarse_sizes(counts, coarse_order(counts));
  const std::int64_t numbering = 2 * kInt * counts.nodes();
  const std::int64_t colouring = 2 * kLong * level.nodes + kLong * counts.cell_count() +
                                 static_cast<std::int64_t>(sizeof(Incidence)) * level.incidences;
  return bytes + kInt * level.in_cells + std::max(numbering, colouring);
}

}  // namespace varimesh
