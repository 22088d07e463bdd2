#include "core/problem/clusters.h"

#include <algorithm>

#include "core/base/shared_work.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 2048, kNodesPerTask = 8192;

/// The vertices of each cell, and the cells at each vertex in ascending order.
struct Neighbourhoods {
  std::vector<const std::int32_t*> vertices;  // by cell
  std::vector<std::int8_t> vertex_count;      // by cell
  std::vector<std::int32_t> begin;            // by node: where its cells begin in `cells`
  std::vector<std::int32_t> cells;
  std::vector<std::int32_t> looked_at;  // by node: the last cluster for which its cells were looked at

  Neighbourhoods(const HighOrderMesh& mesh, const Team& team) : begin(mesh.node_count() + 1, 0) {
    const std::size_t count = mesh.element_count(mesh.dimension);
    vertices.resize(count);
    vertex_count.resize(count);
    std::size_t first = 0;
    for (const ElementBlock& block : mesh.blocks) {
      const reference::ShapeInfo& shape = reference::info(block.shape);
      if (shape.dimension != mesh.dimension) continue;
      const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
      team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t from, std::size_t to) {
        for (std::size_t e = from; e < to; ++e) {
          vertices[first + e] = block.nodes.data() + e * stride;
          vertex_count[first + e] = static_cast<std::int8_t>(shape.vertices);
          for (int v = 0; v < shape.vertices; ++v) count_up(begin[vertices[first + e][v]], team);
        }
      });
      first += block.size();
    }
    cells.resize(static_cast<std::size_t>(sums_before(begin)));
    list_cells(team);
  }

 private:
  /// The threads enter the cells in any order, so each list is sorted afterwards.
  void list_cells(const Team& team) {
    std::vector<std::int32_t> next = begin;
    team.for_ranges(vertices.size(), kCellsPerTask, [&](std::size_t from, std::size_t to) {
      for (std::size_t cell = from; cell < to; ++cell)
        for (int v = 0; v < vertex_count[cell]; ++v)
          cells[count_up(next[vertices[cell][v]], team)] = static_cast<std::int32_t>(cell);
    });
    looked_at = std::move(next);
    team.for_ranges(looked_at.size(), kNodesPerTask, [&](std::size_t from, std::size_t to) {
      for (std::size_t node = from; node < to; ++node) looked_at[node] = -1;
      if (team.threads() == 1) return;
      for (std::size_t node = from; node < std::min(to, looked_at.size() - 1); ++node)
        std::sort(cells.data() + begin[node], cells.data() + begin[node + 1]);
    });
  }
};

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

}  // namespace

Clusters cluster_cells(const HighOrderMesh& mesh, std::int32_t size, const Team& team) {
  Neighbourhoods near(mesh, team);
  Clusters clusters;
  clusters.cells.reserve(near.vertices.size());
  std::vector<char> taken(near.vertices.size(), 0), waits(near.vertices.size(), 0);
  std::vector<std::int32_t> in_front_of(near.vertices.size(), -1);  // the last cluster in whose `front` a cell was
  Queue front;                                                      // neighbours of the cluster that grows
  Queue waiting;                                                    // neighbours of all clusters, oldest first
  std::int32_t room = 0, cluster = -1;
  const auto take = [&](std::int32_t cell) {
    if (room == 0) {
      clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
      room = size;
      front.clear();
      ++cluster;
    }
    taken[cell] = 1;
    clusters.cells.push_back(cell);
    --room;
    for (int v = 0; v < near.vertex_count[cell]; ++v) {
      const std::int32_t vertex = near.vertices[cell][v];
      // If this cluster has come to the vertex before, all cells there are taken or in both queues.
      if (std::exchange(near.looked_at[vertex], cluster) == cluster) continue;
      for (std::int32_t i = near.begin[vertex]; i < near.begin[vertex + 1]; ++i) {
        const std::int32_t other = near.cells[i];
        if (taken[other] != 0 || std::exchange(in_front_of[other], cluster) == cluster) continue;
        front.cells.push_back(other);
        if (waits[other] == 0) waiting.cells.push_back(other);
        waits[other] = 1;
      }
    }
  };
  for (std::size_t seed = 0; seed < near.vertices.size(); ++seed) {
    if (taken[seed] != 0) continue;
    take(static_cast<std::int32_t>(seed));
    while (!waiting.empty()) {
      const std::int32_t cell = room > 0 && !front.empty() ? front.pop() : waiting.pop();
      if (taken[cell] == 0) take(cell);
    }
  }
  clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
  return clusters;
}

}  // namespace varimesh
