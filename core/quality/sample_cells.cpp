#include "core/quality/sample_cells.h"

#include <algorithm>
#include <array>

namespace varimesh::detail {
namespace {

constexpr std::size_t kBatchesPerTask = 8;

/// Samples batches of one table: all of them in one range of points, then in the next.
void sample_batches(std::span<const double> coordinates, const LatticeTable& table, std::span<const CellBatch> batches,
                    const Team& team, std::span<Extremes> cells) {
  thread_local std::vector<double> workspace;
  std::array<const std::int32_t*, kMostLatticeLanes> nodes{};
  std::array<LatticeProgress, kBatchesPerTask> progress;
  LatticeRows made;
  for (std::size_t range = 0; range < table.ranges(); ++range) {
    const LatticeRows& rows = table.rows(range, made);
    for (std::size_t b = 0; b < batches.size(); ++b) {
      team.look();
      for (std::size_t i = 0; i < batches[b].count; ++i) nodes[i] = batches[b].nodes(i);
      sample_rows(table, rows, {coordinates.data(), nodes.data(), batches[b].count}, workspace, progress[b]);
    }
  }
  for (std::size_t b = 0; b < batches.size(); ++b)
    finish_samples(table, progress[b], batches[b].count, &cells[batches[b].cell]);
}

}  // namespace

std::vector<CellBatch> batches_to_sample(const HighOrderMesh& mesh) {
  const std::size_t lanes = lattice_lanes();
  return cell_batches(mesh, [&](const ElementBlock&) { return lanes; });
}

void sample_cells(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals,
                  std::span<const CellBatch> batches, const Team& team, std::span<Extremes> cells) {
  team.for_ranges(batches.size(), kBatchesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t last = begin; begin != end; begin = last) {
      const ElementBlock& block = *batches[begin].block;
      while (last != end && last - begin < kBatchesPerTask && batches[last].block == &block) ++last;
      sample_batches(coordinates, lattice_table(block.shape, block.order, intervals, mesh.dimension),
                     batches.subspan(begin, last - begin), team, cells);
    }
  });
}

bool SamplesOfRanks::sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals,
                            const Team& team, std::vector<Extremes>& cells) {
  const std::vector<CellBatch> batches = batches_to_sample(mesh);
  team.look_together();
  const auto [begin, end] = share_of(batches.size(), ranks_);
  sample_cells(mesh, coordinates, intervals, std::span(batches).subspan(begin, end - begin), team, cells);
  // Batches follow each other, so the cells of a share are a range.
  const auto first = begin < end ? batches[begin].cell : 0;
  const auto last = begin < end ? batches[end - 1].cell + batches[end - 1].count : 0;
  const auto at = [&](std::size_t cell) { return cells.begin() + static_cast<std::ptrdiff_t>(cell); };
  const std::vector<Extremes> all = ranks_.gather_everywhere(std::vector<Extremes>(at(first), at(last)));
  std::ranges::copy(all, cells.begin());
  return true;
}

}  // namespace varimesh::detail
