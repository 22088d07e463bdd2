// Cells are sampled for the quality report.
#include <algorithm>

#include "core/base/index.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/kernels/hessian/batch.h"

namespace varimesh {
namespace {

/// About as many bytes of nodes are on the device at a time.
constexpr std::size_t kBytesTogether = std::size_t{64} << 20;
constexpr std::size_t kNumbers = std::tuple_size_v<decltype(detail::LatticeProgress::lanes)>;
constexpr std::size_t kBatchesPerTask = 256;

static_assert(kBatch <= detail::kMostLatticeLanes);

/// What the progress of the cells of a block says.
void finish(const detail::CellBatch& block, const detail::LatticeTable& table, std::span<const double> progress,
            const Team& team, std::vector<detail::Extremes>& cells) {
  team.for_ranges(progress.size() / (kNumbers * kBatch), kBatchesPerTask, [&](std::size_t begin, std::size_t end) {
    detail::LatticeProgress of_batch;
    for (std::size_t batch = begin; batch < end; ++batch) {
      for (std::size_t i = 0; i < kNumbers; ++i)
        std::ranges::copy(progress.subspan((batch * kNumbers + i) * kBatch, kBatch), of_batch.lanes[i].begin());
      const std::size_t first = batch * kBatch;
      detail::finish_samples(table, of_batch, std::min<std::size_t>(kBatch, block.count - first),
                             &cells[block.cell + first]);
    }
  });
}

}  // namespace

void JudgeOnDevice::sample_block(const detail::CellBatch& block, const detail::LatticeTable& table,
                                 const device::Buffer& coordinates, const Team& team,
                                 std::vector<detail::Extremes>& cells) {
  const std::size_t nodes = at(table.nodes()), d = at(table.dimension());
  const std::size_t batches = (block.count + kBatch - 1) / kBatch, batch_numbers = nodes * d * kBatch;
  const std::size_t together = std::clamp<std::size_t>(kBytesTogether / (batch_numbers * sizeof(double)), 1, batches);
  device::Buffer lists, gradients, straight;
  queue_->fill(lists, std::span(block.nodes(0), block.count * nodes));
  const device::Buffer relative = queue_->room(together * batch_numbers * sizeof(double));
  std::vector<double> progress(batches * kNumbers * kBatch);
  const device::Buffer kept = queue_->room(progress.size() * sizeof(double));
  detail::LatticeRows made;
  for (std::size_t range = 0; range < table.ranges() && queue_->is_well(); ++range) {
    const detail::LatticeRows& rows = table.rows(range, made);
    queue_->fill(gradients, rows.gradients);
    queue_->fill(straight, rows.straight);
    for (std::size_t batch = 0; batch < batches; batch += together) {
      team.look();
      const std::size_t first = batch * kBatch, count = std::min(together * kBatch, block.count - first);
      const auto now = static_cast<std::int32_t>((count + kBatch - 1) / kBatch);
      queue_->launch(kernels_.relative_nodes, std::int64_t{now} * table.nodes() * kBatch,
                     device::RelativeArguments{static_cast<std::int32_t>(count), table.nodes(), 1,
                                               lists.as<const std::int32_t>() + first * nodes,
                                               coordinates.as<const double>(), relative.as<double>()});
      queue_->launch(
          kernels_.sample, std::int64_t{now} * kBatch,
          device::SampleArguments{now, table.nodes(), table.vertices(), static_cast<std::int64_t>(rows.first),
                                  static_cast<std::int64_t>(rows.count), gradients.as<const double>(),
                                  straight.as<const double>(), relative.as<const double>(),
                                  kept.as<double>() + batch * kNumbers * kBatch});
    }
  }
  queue_->download(kept, std::span(progress));
  if (queue_->is_well()) finish(block, table, progress, team, cells);
}

bool JudgeOnDevice::sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals,
                           const Team& team, std::vector<detail::Extremes>& cells) {
  if (!begin()) return false;
  device::Buffer there;
  queue_->fill(there, coordinates);
  for (const detail::CellBatch& block : detail::whole_blocks(mesh)) {
    if (!queue_->is_well()) break;
    sample_block(block, detail::lattice_table(block.block->shape, block.block->order, intervals, mesh.dimension), there,
                 team, cells);
  }
  return is_well();
}

}  // namespace varimesh
