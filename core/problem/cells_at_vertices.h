// Which cells have a vertex, and which cells lie around a cell. Internal to the library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// The cells of every vertex of a mesh.
class CellsAtVertices {
 public:
  /// No vertex has a cell yet.
  CellsAtVertices() = default;
  /// @param nodes  how many nodes the mesh has
  CellsAtVertices(const Cells& cells, std::size_t nodes) : first_(nodes + 1, 0) {
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (const std::int32_t vertex : vertices_of(cells, cell)) ++first_[at(vertex) + 1];
    for (std::size_t n = 0; n < nodes; ++n) first_[n + 1] += first_[n];
    cells_.resize(at(first_.back()));
    std::vector<std::int64_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (const std::int32_t vertex : vertices_of(cells, cell))
        cells_[at(next[at(vertex)]++)] = static_cast<std::int32_t>(cell);
  }

  static std::span<const std::int32_t> vertices_of(const Cells& cells, std::size_t cell) {
    return cells.nodes(cell).first(at(reference::info(cells.shape(cell)).vertices));
  }

  /// The cells that have the vertex, in ascending order.
  std::span<const std::int32_t> of(std::int32_t vertex) const {
    const std::int64_t first = first_[at(vertex)];
    return std::span(cells_).subspan(at(first), at(first_[at(vertex) + 1] - first));
  }

  /// The cell, and the cells in so many layers around it, in ascending order. Each layer has the cells that share a
  /// vertex with the layers inside it.
  /// @param cells  those that this object was made of
  std::vector<std::int32_t> around(const Cells& cells, std::int32_t cell, int layers) const {
    std::vector<std::int32_t> result{cell};
    for (int layer = 0; layer < layers; ++layer) {
      std::vector<std::int32_t> more;
      for (const std::int32_t each : result)
        for (const std::int32_t vertex : vertices_of(cells, at(each))) {
          const auto here = of(vertex);
          more.insert(more.end(), here.begin(), here.end());
        }
      std::ranges::sort(more);
      more.erase(std::unique(more.begin(), more.end()), more.end());
      result = std::move(more);
    }
    return result;
  }

 private:
  std::vector<std::int64_t> first_;  // by node, into cells_
  std::vector<std::int32_t> cells_;
};

}  // namespace varimesh::detail
