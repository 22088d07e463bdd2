#include "core/problem/clusters/clusters.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/base/shared_work.h"
#include "core/problem/clusters/regions.h"

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 8192;
/// A cluster in a region's corner is smaller than the others, so a region has many.
constexpr std::size_t kClustersPerRegion = 64, kFewestCellsPerRegion = 4096;

/// A queue that keeps its memory.
struct Queue {
  std::vector<std::int32_t> cells;
  std::size_t head = 0;
  bool empty() const { return head == cells.size(); }
  std::int32_t pop() { return cells[head++]; }
  void clear() {
    cells.clear();
    head = 0;
  }
};

struct CellMarks {
  std::int32_t in_front_of = -1;  // the last cluster that the cell was beside when it grew
  bool taken = false, waits = false;
};

/// What regions that grow at the same time share. Each has its own cells and inner vertices.
struct Marks {
  std::vector<CellMarks> cells;
  /// By node: the last cluster for which its cells were looked at; kBetween for a vertex of several regions.
  std::vector<std::int32_t> looked_at;

  static constexpr std::int32_t kBetween = -2;

  Marks(const CellNeighbours& near, const Regions& regions, const Team& team)
      : cells(near.cell_count()), looked_at(near.node_count(), -1) {
    if (regions.count() == 1) return;
    team.for_ranges(near.node_count(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node) {
        const std::span<const std::int32_t> around = near.cells_at(node);
        const auto is_other = [&](std::int32_t cell) { return regions.of[at(cell)] != regions.of[at(around.front())]; };
        if (std::ranges::any_of(around, is_other)) looked_at[node] = kBetween;
      }
    });
  }
};

/// Grows the clusters of one region.
class RegionClusters {
 public:
  /// `begins`: receives where each cluster begins in `cells`, which has room for all regions.
  RegionClusters(const CellNeighbours& near, const Regions& regions, std::int32_t region, std::int32_t size,
                 Marks& marks, std::vector<std::int32_t>& cells, std::vector<std::int32_t>& begins)
      : near_(near),
        regions_(regions),
        region_(region),
        size_(size),
        marks_(marks),
        cells_(cells),
        begins_(begins),
        next_(regions.begin[at(region)]) {}

  void grow() {
    for (std::int32_t i = regions_.begin[at(region_)]; i < regions_.begin[at(region_) + 1]; ++i) {
      const std::int32_t seed = regions_.cells[at(i)];
      if (marks_.cells[at(seed)].taken) continue;
      take(seed);
      while (!waiting_.empty()) {
        const std::int32_t cell = room_ > 0 && !front_.empty() ? front_.pop() : waiting_.pop();
        if (!marks_.cells[at(cell)].taken) take(cell);
      }
    }
  }

 private:
  void take(std::int32_t cell) {
    if (room_ == 0) {
      begins_.push_back(next_);
      room_ = size_;
      front_.clear();
    }
    marks_.cells[at(cell)].taken = true;
    cells_[at(next_++)] = cell;
    --room_;
    for (const std::int32_t vertex : near_.vertices(at(cell))) look_at(vertex);
  }

  void look_at(std::int32_t vertex) {
    const std::int32_t cluster = begins_.back();  // where it begins is its name
    std::int32_t& looked_at = marks_.looked_at[at(vertex)];
    const bool is_between = looked_at == Marks::kBetween;
    // If this cluster has come to the vertex before, all cells there are taken or in both queues.
    if (!is_between && std::exchange(looked_at, cluster) == cluster) return;
    for (const std::int32_t other : near_.cells_at(at(vertex))) {
      if (is_between && regions_.of[at(other)] != region_) continue;
      CellMarks& marks = marks_.cells[at(other)];
      if (marks.taken || std::exchange(marks.in_front_of, cluster) == cluster) continue;
      front_.cells.push_back(other);
      if (!marks.waits) waiting_.cells.push_back(other);
      marks.waits = true;
    }
  }

  const CellNeighbours& near_;
  const Regions& regions_;
  const std::int32_t region_, size_;
  Marks& marks_;
  std::vector<std::int32_t>&cells_, &begins_;
  std::int32_t next_;      // where the next cell goes in cells_
  std::int32_t room_ = 0;  // in the cluster that grows
  Queue front_;            // neighbours of the cluster that grows
  Queue waiting_;          // neighbours of all clusters of the region, oldest first
};

}  // namespace

Clusters cluster_cells(const HighOrderMesh& mesh, std::int32_t size, const Team& team) {
  const CellNeighbours near(mesh, team);
  const Regions regions = grow_regions(near, std::max(kClustersPerRegion * at(size), kFewestCellsPerRegion), team);
  Marks marks(near, regions, team);
  Clusters clusters;
  clusters.cells.resize(near.cell_count());
  std::vector<std::vector<std::int32_t>> begins(regions.count());
  team.for_each(static_cast<std::int32_t>(regions.count()), 1, [&](std::int32_t region) {
    RegionClusters(near, regions, region, size, marks, clusters.cells, begins[at(region)]).grow();
  });
  for (const std::vector<std::int32_t>& of_region : begins)
    clusters.begin.insert(clusters.begin.end(), of_region.begin(), of_region.end());
  clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
  return clusters;
}

}  // namespace varimesh
