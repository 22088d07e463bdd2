// Notes for each degree of freedom of edges and faces the node that a cell has there, and compares it with the others.
#include "core/formats/mfem/shared_sides.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>

namespace varimesh::formats {
namespace {
constexpr std::size_t kCellsPerTask = 2048;
}

bool are_at_one_place(const HighOrderMesh& mesh, std::int32_t a, std::int32_t b) {
  const double* const x = mesh.coordinates.data();
  return a == b || std::equal(x + 3 * std::size_t(a), x + 3 * std::size_t(a) + 3, x + 3 * std::size_t(b));
}

void SmallestCell::take(std::size_t cell) {
  std::size_t now = smallest_;
  while (cell < now && !smallest_.compare_exchange_weak(now, cell)) {
  }
}

std::optional<std::size_t> find_unshared_side(const HighOrderMesh& mesh, const Cells& cells,
                                              const TopologyCells& vertices, const MfemTopology& topology,
                                              const Team& team) {
  const std::int64_t first = topology.vertex_count(), end = topology.interior_first();
  const auto count = std::size_t(end - first);
  // The node of each degree of freedom plus one; 0: no cell has come to it.
  const auto node_of = std::make_unique<std::atomic<std::int32_t>[]>(count);
  SmallestCell found;
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
      if (!fits) found.take(cell);
    });
  });
  return found.get();
}

tl::unexpected<Error> unshared_side(const Cells& cells, std::size_t cell, std::string_view format) {
  return bad_option("Element " + std::to_string(cells.number(cell)) +
                    " has other nodes on an edge or face than an element with the same vertices there, which " +
                    std::string(format) + " format cannot hold; join the nodes, or write msh or vtu.");
}

Expected<void> check_distinct_vertices(const Cells& cells, std::string_view format) {
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto nodes = cells.nodes(cell).first(std::size_t(reference::info(cells.shape(cell)).vertices));
    for (std::size_t v = 1; v < nodes.size(); ++v)
      if (std::find(nodes.begin(), nodes.begin() + std::ptrdiff_t(v), nodes[v]) != nodes.begin() + std::ptrdiff_t(v))
        return bad_option("Element " + std::to_string(cells.number(cell)) +
                          " has a node as two of its vertices, which " + std::string(format) +
                          " format cannot hold; mend the element, or write msh or vtu.");
  }
  return {};
}

}  // namespace varimesh::formats
