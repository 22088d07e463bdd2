#include "core/quality/quality_memory.h"

#include <algorithm>

#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/lattice_kernel.h"
#include "core/quality/quality.h"
#include "core/validity/cell_batches.h"

namespace varimesh {
namespace {

constexpr std::int64_t kDouble = sizeof(double);

/// Points of the lattice of a report.
std::int64_t lattice_points(Shape shape, int order) {
  return reference::uniform_lattice(shape, report_intervals(order)).rows();
}

/// Numbers per point that the bases of a cell's factors have: 0 if the cell is no product.
std::int64_t factor_tables(Shape shape, int order) {
  const std::int64_t line = reference::node_count(Shape::Line, order);
  if (shape == Shape::Quadrilateral) return 4 * line;
  if (shape == Shape::Hexahedron) return 6 * line;
  return shape == Shape::Prism ? 2 * line + 3 * reference::node_count(Shape::Triangle, order) : 0;
}

}  // namespace

std::int64_t bytes_of_quality(const MeshCounts& counts) {
  const std::int64_t cells = counts.cell_count();
  const auto lanes = static_cast<std::int64_t>(detail::lattice_lanes());
  // Extremes, batches, two ratios per cell, and the order in which certificates are sharpened.
  return cells * static_cast<std::int64_t>(sizeof(detail::Extremes) + 2 * sizeof(double) + sizeof(std::int32_t)) +
         cells / lanes * static_cast<std::int64_t>(sizeof(detail::CellBatch)) + bytes_of_accuracy(counts);
}

std::int64_t bytes_of_lattice_tables(const MeshCounts& counts) {
  const std::int64_t d = counts.dimension;
  std::int64_t bytes = bytes_of_accuracy_tables(counts);
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const auto shape = static_cast<Shape>(s);
    const std::int64_t points = lattice_points(shape, counts.order);
    const std::int64_t row = kDouble * d * reference::node_count(shape, counts.order);
    const bool is_kept = points * row <= detail::kMostLatticeBytes;
    // Rows that are not kept are made from gradients of the same size.
    bytes += (is_kept ? points * row : 2 * std::max(row, detail::kMostLatticeBytes)) +
             points * kDouble * (d + factor_tables(shape, counts.order) + factor_tables(shape, 1));
  }
  return bytes;
}

}  // namespace varimesh
