// Cells are sampled for the quality report.
#include <algorithm>
#include <map>
#include <utility>

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

/// Blocks of one shape and order.
using Blocks = std::vector<detail::CellBatch>;

/// The node lists of the cells, one block after another; `joined` has them if they are in several blocks.
std::span<const std::int32_t> node_lists(const Blocks& blocks, std::size_t nodes, std::vector<std::int32_t>& joined) {
  if (blocks.size() == 1) return {blocks[0].nodes(0), blocks[0].count * nodes};
  for (const detail::CellBatch& block : blocks)
    joined.insert(joined.end(), block.nodes(0), block.nodes(0) + block.count * nodes);
  return joined;
}

/// What the progress of `count` cells says.
std::vector<detail::Extremes> finished(const detail::LatticeTable& table, std::size_t count,
                                       std::span<const double> progress, const Team& team) {
  std::vector<detail::Extremes> found(count);
  team.for_ranges(progress.size() / (kNumbers * kBatch), kBatchesPerTask, [&](std::size_t begin, std::size_t end) {
    detail::LatticeProgress of_batch;
    for (std::size_t batch = begin; batch < end; ++batch) {
      for (std::size_t i = 0; i < kNumbers; ++i)
        std::ranges::copy(progress.subspan((batch * kNumbers + i) * kBatch, kBatch), of_batch.lanes[i].begin());
      const std::size_t first = batch * kBatch;
      detail::finish_samples(table, of_batch, std::min<std::size_t>(kBatch, count - first), &found[first]);
    }
  });
  return found;
}

}  // namespace

void JudgeOnDevice::sample_alike(const Blocks& blocks, const detail::LatticeTable& table,
                                 const device::Buffer& coordinates, const Team& team,
                                 std::vector<detail::Extremes>& cells) {
  const std::size_t nodes = at(table.nodes()), d = at(table.dimension());
  std::vector<std::int32_t> joined;
  const std::span<const std::int32_t> of_cells = node_lists(blocks, nodes, joined);
  const std::size_t all = of_cells.size() / nodes, batches = (all + kBatch - 1) / kBatch;
  const std::size_t batch_numbers = nodes * d * kBatch;
  const std::size_t together = std::clamp<std::size_t>(kBytesTogether / (batch_numbers * sizeof(double)), 1, batches);
  device::Buffer lists, gradients, straight;
  queue_->fill(lists, of_cells);
  const device::Buffer relative = queue_->room(together * batch_numbers * sizeof(double));
  std::vector<double> progress(batches * kNumbers * kBatch);
  const device::Buffer kept = queue_->room(progress.size() * sizeof(double));
  detail::LatticeRows made;
  for (std::size_t range = 0; range < table.ranges() && queue_->is_well(); ++range) {
    const detail::LatticeRows& rows = table.rows(range, made);
    queue_->fill(gradients, rows.gradients);
    queue_->fill(straight, rows.straight);
    for (std::size_t batch = 0; batch < batches && queue_->is_well(); batch += together) {
      const std::size_t first = batch * kBatch, count = std::min(together * kBatch, all - first);
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
      // Whoever stops the run does not wait for more than this.
      queue_->note(used_device()->wait());
      team.look();
    }
  }
  queue_->download(kept, std::span(progress));
  if (!queue_->is_well()) return;
  const std::vector<detail::Extremes> found = finished(table, all, progress, team);
  auto from = found.begin();
  for (const detail::CellBatch& block : blocks) {
    const auto end = from + static_cast<std::ptrdiff_t>(block.count);
    std::copy(from, end, cells.begin() + static_cast<std::ptrdiff_t>(block.cell));
    from = end;
  }
}

bool JudgeOnDevice::sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals,
                           const Team& team, std::vector<detail::Extremes>& cells) {
  if (!begin()) return false;
  device::Buffer there;
  queue_->fill(there, coordinates);
  // A mesh of a CAD model has one block for each volume. Many of these blocks may be small.
  std::map<std::pair<Shape, int>, Blocks> alike;
  for (const detail::CellBatch& block : detail::whole_blocks(mesh))
    alike[{block.block->shape, block.block->order}].push_back(block);
  for (const auto& [kind, blocks] : alike)
    if (queue_->is_well())
      sample_alike(blocks, detail::lattice_table(kind.first, kind.second, intervals, mesh.dimension), there, team,
                   cells);
  return is_well();
}

}  // namespace varimesh
