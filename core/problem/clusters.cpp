#include "core/problem/clusters.h"

#include <deque>

namespace varimesh {
namespace {

/// The vertices of each cell, and the cells at each vertex.
struct Neighbourhoods {
  std::vector<const std::int32_t*> vertices;  // by cell
  std::vector<int> vertex_count;              // by cell
  std::vector<std::int32_t> begin;            // by node: where its cells begin in `cells`
  std::vector<std::int32_t> cells;

  explicit Neighbourhoods(const HighOrderMesh& mesh) : begin(mesh.node_count() + 1, 0) {
    for (const ElementBlock& block : mesh.blocks) {
      const reference::ShapeInfo& shape = reference::info(block.shape);
      if (shape.dimension != mesh.dimension) continue;
      const int stride = reference::node_count(block.shape, block.order);
      for (std::size_t e = 0; e < block.size(); ++e) {
        vertices.push_back(block.nodes.data() + e * static_cast<std::size_t>(stride));
        vertex_count.push_back(shape.vertices);
        for (int v = 0; v < shape.vertices; ++v) ++begin[vertices.back()[v] + 1];
      }
    }
    for (std::size_t node = 0; node + 1 < begin.size(); ++node) begin[node + 1] += begin[node];
    cells.resize(begin.back());
    std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
    for (std::size_t cell = 0; cell < vertices.size(); ++cell)
      for (int v = 0; v < vertex_count[cell]; ++v) cells[next[vertices[cell][v]]++] = static_cast<std::int32_t>(cell);
  }
};

}  // namespace

Clusters cluster_cells(const HighOrderMesh& mesh, std::int32_t size) {
  const Neighbourhoods near(mesh);
  Clusters clusters;
  std::vector<char> taken(near.vertices.size(), 0), waits(near.vertices.size(), 0);
  std::deque<std::int32_t> front;    // neighbours of the cluster that grows
  std::deque<std::int32_t> waiting;  // neighbours of all clusters, oldest first
  std::int32_t room = 0;
  const auto take = [&](std::int32_t cell) {
    if (room == 0) {
      clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
      room = size;
      front.clear();
    }
    taken[cell] = 1;
    clusters.cells.push_back(cell);
    --room;
    for (int v = 0; v < near.vertex_count[cell]; ++v)
      for (std::int32_t i = near.begin[near.vertices[cell][v]]; i < near.begin[near.vertices[cell][v] + 1]; ++i) {
        const std::int32_t other = near.cells[i];
        if (taken[other] != 0) continue;
        front.push_back(other);
        if (waits[other] == 0) waiting.push_back(other);
        waits[other] = 1;
      }
  };
  for (std::size_t seed = 0; seed < near.vertices.size(); ++seed) {
    if (taken[seed] != 0) continue;
    take(static_cast<std::int32_t>(seed));
    while (!waiting.empty()) {
      std::deque<std::int32_t>& queue = room > 0 && !front.empty() ? front : waiting;
      const std::int32_t cell = queue.front();
      queue.pop_front();
      if (taken[cell] == 0) take(cell);
    }
  }
  clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
  return clusters;
}

}  // namespace varimesh
