// Notes for each degree of freedom of edges and faces the node that a cell has there, and compares it with the others.
#include "core/formats/mfem/shared_sides.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>

namespace varimesh::formats {
namespace {

constexpr std::size_t kCellsPerTask = 2048;

bool are_at_one_place(const HighOrderMesh& mesh, std::int32_t a, std::int32_t b) {
  const double* const x = mesh.coordinates.data();
  return a == b || std::equal(x + 3 * std::size_t(a), x + 3 * std::size_t(a) + 3, x + 3 * std::size_t(b));
}

/// The smallest value that any thread has given.
void lower(std::atomic<std::size_t>& smallest, std::size_t value) {
  std::size_t now = smallest;
  while (value < now && !smallest.compare_exchange_weak(now, value)) {
  }
}

}  // namespace

std::optional<std::size_t> find_unshared_side(const HighOrderMesh& mesh, const Cells& cells, const MfemCells& vertices,
                                              const MfemTopology& topology, const Team& team) {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  const std::int64_t first = topology.vertex_count(), end = topology.interior_first();
  const auto count = std::size_t(end - first);
  // The node of each degree of freedom plus one; 0: no cell has come to it.
  const auto node_of = std::make_unique<std::atomic<std::int32_t>[]>(count);
  std::atomic<std::size_t> found = kNone;
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t stop) {
    std::vector<std::int32_t> dofs;
    vertices.visit(begin, stop, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> corners) {
      const std::span<const std::int32_t> nodes = cells.nodes(cell);
      dofs.resize(nodes.size());
      bool fits = topology.find_nodes(shape, corners, std::int32_t(end), dofs);
      for (std::size_t i = 0; i < nodes.size() && fits; ++i) {
        if (dofs[i] < first || dofs[i] >= end) continue;
        std::int32_t other = 0;
        std::atomic<std::int32_t>& noted = node_of[std::size_t(dofs[i] - first)];
        fits = noted.compare_exchange_strong(other, nodes[i] + 1) || are_at_one_place(mesh, nodes[i], other - 1);
      }
      if (!fits) lower(found, cell);
    });
  });
  return found == kNone ? std::nullopt : std::optional(found.load());
}

}  // namespace varimesh::formats
