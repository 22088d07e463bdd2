#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/validity/cell_batches.h"

namespace varimesh {
namespace {

using detail::CellBatch;

constexpr double kMostWeight = 16;
constexpr int kRounds = 3;

/// Calls use(cell, its vertices) for all cells in the mesh's order.
template <class Use>
void for_cells(const HighOrderMesh& mesh, const Use& use) {
  for (const CellBatch& block : detail::whole_blocks(mesh)) {
    const std::size_t vertices = at(reference::info(block.block->shape).vertices);
    for (std::size_t i = 0; i < block.count; ++i) use(block.cell + i, std::span(block.nodes(i), vertices));
  }
}

/// The logarithm of the volume of each cell; minus infinity where it is 0.
std::vector<double> log_volumes(const HighOrderMesh& mesh, const Team& team) {
  std::vector<double> logs(mesh.element_count(mesh.dimension));
  const auto batches = detail::cell_batches(mesh, [](const ElementBlock&) { return kAccuracyBatch; });
  const int d = mesh.dimension;
  team.for_ranges(batches.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const CellBatch& batch = batches[b];
      const detail::PartsTable& table =
          detail::parts_table(batch.block->shape, batch.block->order, reference::NodeSet::Equispaced, team.stop());
      Eigen::MatrixXd x(table.mean_gradient.cols(), d);
      for (std::size_t i = 0; i < batch.count; ++i) {
        for (Eigen::Index n = 0; n < x.rows(); ++n)
          for (int c = 0; c < d; ++c) x(n, c) = mesh.coordinates[3 * at(batch.nodes(i)[n]) + at(c)];
        const double volume = std::abs((table.mean_gradient * x).determinant());
        logs[batch.cell + i] = std::log(volume * reference::info(batch.block->shape).measure);
      }
    }
  });
  return logs;
}

}  // namespace

std::vector<double> local_weights(const HighOrderMesh& mesh, const Team& team) {
  const std::vector<double> logs = log_volumes(mesh, team);
  const auto counts = [&](std::size_t cell) { return std::isfinite(logs[cell]); };
  std::vector<double> around = logs, sums(mesh.node_count());
  std::vector<std::int32_t> cells_at(mesh.node_count(), 0);
  for_cells(mesh, [&](std::size_t cell, std::span<const std::int32_t> vertices) {
    for (const std::int32_t node : vertices) cells_at[at(node)] += counts(cell) ? 1 : 0;
  });
  for (int round = 0; round < kRounds; ++round) {
    std::ranges::fill(sums, 0.0);
    for_cells(mesh, [&](std::size_t cell, std::span<const std::int32_t> vertices) {
      if (!counts(cell)) return;
      for (const std::int32_t node : vertices) sums[at(node)] += around[cell];
    });
    for_cells(mesh, [&](std::size_t cell, std::span<const std::int32_t> vertices) {
      if (!counts(cell)) return;
      double sum = 0;
      for (const std::int32_t node : vertices) sum += sums[at(node)] / cells_at[at(node)];
      around[cell] = sum / static_cast<double>(vertices.size());
    });
  }
  std::vector<double> weights(logs.size(), 1.0);
  const double power = 1 + 2.0 / mesh.dimension;
  for (std::size_t cell = 0; cell < logs.size(); ++cell)
    if (counts(cell))
      weights[cell] = std::clamp(std::exp(power * (logs[cell] - around[cell])), 1 / kMostWeight, kMostWeight);
  return weights;
}

}  // namespace varimesh
