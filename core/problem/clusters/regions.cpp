#include "core/problem/clusters/regions.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <numeric>

#include "core/base/index.h"
#include "core/base/shared_work.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 2048, kNodesPerTask = 8192;
constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();

/// A region that was decided in an earlier step. It is lower than all regions of this step, so that none replaces it.
constexpr std::int32_t settled(std::int32_t region) { return -1 - region; }

/// Grows all regions by one cell at a time. Cells and vertices have kNone, a region of this step, or settled() of it.
class Growth {
 public:
  Growth(const CellNeighbours& near, std::size_t seeds, const Team& team)
      : near_(near), team_(team), of_cell_(near.cell_count(), kNone), of_vertex_(near.node_count(), kNone) {
    for (std::size_t region = 0; region < seeds; ++region) {
      const std::size_t cell = (2 * region + 1) * near.cell_count() / (2 * seeds);
      of_cell_[cell] = settled(static_cast<std::int32_t>(region));
      cells_.push_back(static_cast<std::int32_t>(cell));
    }
  }

  /// By cell: settled() of its region, or kNone.
  std::vector<std::int32_t> grow() {
    while (!cells_.empty()) {
      spread(
          cells_, of_cell_, [&](std::int32_t cell) { return near_.vertices(at(cell)); }, vertices_, of_vertex_);
      spread(
          vertices_, of_vertex_, [&](std::int32_t vertex) { return near_.cells_at(at(vertex)); }, cells_, of_cell_);
    }
    return std::move(of_cell_);
  }

 private:
  /// Gives what `from` touches, and what has no region yet, the lowest region that touches it, and lists it in `next`.
  /// The order of the list depends on the threads; the regions do not.
  template <class Touched>
  void spread(const std::vector<std::int32_t>& from, const std::vector<std::int32_t>& region, const Touched& touched,
              std::vector<std::int32_t>& next, std::vector<std::int32_t>& next_region) const {
    next.clear();
    std::mutex mutex;
    team_.for_ranges(from.size(), kCellsPerTask / 8, [&](std::size_t begin, std::size_t end) {
      std::vector<std::int32_t> mine;
      for (std::size_t i = begin; i < end; ++i)
        for (const std::int32_t other : touched(from[i]))
          if (lower_to(next_region[at(other)], settled(region[at(from[i])]), team_) == kNone) mine.push_back(other);
      const std::scoped_lock lock(mutex);
      next.insert(next.end(), mine.begin(), mine.end());
    });
    team_.for_ranges(next.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) next_region[at(next[i])] = settled(next_region[at(next[i])]);
    });
  }

  const CellNeighbours& near_;
  const Team& team_;
  std::vector<std::int32_t> of_cell_, of_vertex_;
  std::vector<std::int32_t> cells_, vertices_;  // what was reached in the last step
};

/// Turns what grow() returned into regions. Cells without one are divided in the order of their numbers. Returns how
/// many regions there are.
std::size_t settle(std::vector<std::int32_t>& of, std::size_t grown, std::size_t size, const Team& team) {
  std::vector<std::size_t> left(chunks_of(of.size(), kCellsPerTask), 0);
  for_chunks(team, of.size(), kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell) left[chunk] += of[cell] == kNone ? 1 : 0;
  });
  const std::size_t all_left = sums_before(left);
  for_chunks(team, of.size(), kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      of[cell] = of[cell] == kNone ? static_cast<std::int32_t>(grown + left[chunk]++ / size) : settled(of[cell]);
  });
  return grown + chunks_of(all_left, size);
}

void list_by_region(Regions& regions, std::size_t count, const Team& team) {
  regions.begin.assign(count + 1, 0);
  const auto for_cells = [&](const auto& body) {
    team.for_ranges(regions.of.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t cell = begin; cell < end; ++cell) body(static_cast<std::int32_t>(cell), regions.of[cell]);
    });
  };
  for_cells([&](std::int32_t, std::int32_t region) { count_up(regions.begin[at(region)], team); });
  regions.cells.resize(at(sums_before(regions.begin)));
  std::vector<std::int32_t> next = regions.begin;
  for_cells(
      [&](std::int32_t cell, std::int32_t region) { regions.cells[at(count_up(next[at(region)], team))] = cell; });
  if (team.threads() == 1) return;
  team.for_each(static_cast<std::int32_t>(count), 1, [&](std::int32_t region) {
    std::sort(regions.cells.data() + regions.begin[at(region)], regions.cells.data() + regions.begin[at(region) + 1]);
  });
}

}  // namespace

CellNeighbours::CellNeighbours(const HighOrderMesh& mesh, const Team& team) : begin_(mesh.node_count() + 1, 0) {
  const std::size_t count = mesh.element_count(mesh.dimension);
  vertices_.resize(count);
  vertex_count_.resize(count);
  std::size_t first = 0;
  for (const ElementBlock& block : mesh.blocks) {
    const reference::ShapeInfo& shape = reference::info(block.shape);
    if (shape.dimension != mesh.dimension) continue;
    const auto stride = at(reference::node_count(block.shape, block.order));
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t from, std::size_t to) {
      for (std::size_t e = from; e < to; ++e) {
        vertices_[first + e] = block.nodes.data() + e * stride;
        vertex_count_[first + e] = static_cast<std::uint8_t>(shape.vertices);
        for (int v = 0; v < shape.vertices; ++v) count_up(begin_[at(vertices_[first + e][v])], team);
      }
    });
    first += block.size();
  }
  cells_.resize(at(sums_before(begin_)));
  list_cells(team);
}

/// The threads enter the cells in any order, so each list is sorted afterwards.
void CellNeighbours::list_cells(const Team& team) {
  std::vector<std::int32_t> next = begin_;
  team.for_ranges(cell_count(), kCellsPerTask, [&](std::size_t from, std::size_t to) {
    for (std::size_t cell = from; cell < to; ++cell)
      for (const std::int32_t vertex : vertices(cell))
        cells_[at(count_up(next[at(vertex)], team))] = static_cast<std::int32_t>(cell);
  });
  if (team.threads() == 1) return;
  team.for_ranges(node_count(), kNodesPerTask, [&](std::size_t from, std::size_t to) {
    for (std::size_t node = from; node < to; ++node)
      std::sort(cells_.data() + begin_[node], cells_.data() + begin_[node + 1]);
  });
}

Regions grow_regions(const CellNeighbours& near, std::size_t size, const Team& team) {
  Regions regions;
  const std::size_t cells = near.cell_count(), seeds = (cells + size / 2) / size;
  if (seeds <= 1) {
    regions.of.assign(cells, 0);
    regions.cells.resize(cells);
    std::iota(regions.cells.begin(), regions.cells.end(), 0);
    regions.begin = {0, static_cast<std::int32_t>(cells)};
    return regions;
  }
  regions.of = Growth(near, seeds, team).grow();
  list_by_region(regions, settle(regions.of, seeds, size, team), team);
  return regions;
}

}  // namespace varimesh
