#include "core/solvers/descent/descent_memory.h"

#include <algorithm>
#include <array>

#include "core/base/index.h"
#include "core/kernels/kernels.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/quality_memory.h"
#include "core/reference/nodes.h"
#include "core/validity/certificate.h"

namespace varimesh {
namespace {

constexpr std::int64_t kDouble = sizeof(double), kInt = sizeof(std::int32_t), kLong = sizeof(std::int64_t);

/// Nodes of cells of this order, all cells added up.
std::int64_t places(const MeshCounts& counts, int order) {
  std::int64_t sum = 0;
  for (std::size_t s = 0; s < kShapes; ++s)
    if (counts.cells[s] > 0) sum += counts.cells[s] * reference::node_count(static_cast<Shape>(s), order);
  return sum;
}

std::int64_t bytes_of_space(const MeshCounts& counts, int order) {
  const std::int64_t lists =
      order < counts.order ? kLong * counts.free_in_cells.nodes(order) + kLong * counts.free.nodes(order) : 0;
  return (kInt + 1) * places(counts, order) + lists;
}

/// With one set of cells, the form uses the room of the energy.
std::int64_t bytes_of_form(const MeshCounts& counts, std::size_t sets) {
  constexpr std::int64_t kMetric = sizeof(std::array<double, 6>);
  const std::int64_t room = sets == 1 ? 0 : kDouble * counts.dimension * places(counts, counts.order);
  return room + (kDouble + kMetric) * counts.cell_count();
}

/// Matrices between the spaces of neighbouring orders, and their transposes. Products over the axes are small beside
/// them, and so are the squares.
std::int64_t bytes_of_order_tables(const MeshCounts& counts) {
  std::int64_t numbers = 0;
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron, Shape::Pyramid, Shape::Prism})
    for (int order = 1; order < counts.order && counts.cells[at(static_cast<int>(shape))] > 0; ++order)
      numbers += std::int64_t{reference::node_count(shape, order)} * reference::node_count(shape, order + 1);
  return 2 * kDouble * numbers;
}

}  // namespace

std::int64_t bytes_of_descent(const MeshCounts& counts, const std::vector<SetSizes>& sets, const NewtonSizes& sizes) {
  const std::int64_t d = counts.dimension, order = counts.order;
  std::int64_t kept =
      bytes_of_form(counts, sets.size()) + bytes_of_order_tables(counts) + bytes_of_accuracy_tables(counts);
  kept += static_cast<std::int64_t>(sizeof(CellScan)) * counts.cell_count();
  for (const SetSizes& set : sets) kept += bytes_of_batches(set, sizes);
  for (int q = 1; q <= order; ++q) kept += bytes_of_space(counts, q) + kDouble * counts.free.nodes(q);
  for (int q = 1; q < order; ++q) kept += 2 * kDouble * d * counts.free.nodes(q);  // residuals, solutions
  // While a space is listed: ranks by node, and where the next place of each free node goes.
  const std::int64_t listing = 2 * kInt * counts.nodes() + kLong * counts.free_nodes();
  // Vectors of the objective and of the round, and what vertices are held with; ε_e and what it follows from; the best
  // mesh, the latest one, and the one that the last round began with.
  constexpr std::int64_t kVectors = 8;
  std::int64_t running = (kVectors * d + 1) * kDouble * counts.free_nodes() + 7 * kDouble * counts.cell_count();
  running += kDouble * d * counts.nodes();
  running += 2 * (3 * kDouble * counts.nodes() + std::int64_t{sizeof(Certificate)} * counts.cell_count());
  // After a round, a copy of the mesh is judged.
  running += std::max(bytes_of_accuracy(counts), bytes_of_mesh(counts) + bytes_of_quality(counts));
  return kept + std::max(listing, running);
}

}  // namespace varimesh
