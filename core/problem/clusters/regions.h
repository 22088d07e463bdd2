// Regions of some thousand cells that are near each other, so that threads can work in several at the same time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The vertices of each cell of dimension mesh.dimension, and the cells at each vertex in ascending order. A cell is
/// given by its number in the mesh's order.
class CellNeighbours {
 public:
  /// The mesh is kept by reference. Call it inside team.run().
  CellNeighbours(const HighOrderMesh& mesh, const Team& team);

  std::size_t cell_count() const { return vertices_.size(); }
  std::size_t node_count() const { return begin_.size() - 1; }
  std::span<const std::int32_t> vertices(std::size_t cell) const { return {vertices_[cell], vertex_count_[cell]}; }
  /// Of a node that is no vertex: none.
  std::span<const std::int32_t> cells_at(std::size_t node) const {
    return {cells_.data() + begin_[node], static_cast<std::size_t>(begin_[node + 1] - begin_[node])};
  }

 private:
  void list_cells(const Team& team);

  std::vector<const std::int32_t*> vertices_;
  std::vector<std::uint8_t> vertex_count_;
  std::vector<std::int32_t> begin_;  // node_count + 1: where the cells of each node begin
  std::vector<std::int32_t> cells_;
};

struct Regions {
  std::vector<std::int32_t> of;     ///< By cell: its region.
  std::vector<std::int32_t> cells;  ///< Region by region, ascending in each.
  std::vector<std::int32_t> begin;  ///< regions + 1: where each region begins in `cells`.

  std::size_t count() const { return begin.size() - 1; }
};

/// Divides the cells into regions of about `size` cells. All regions grow at the same time, from cells that are spread
/// evenly over the numbers. Each takes the cells at the vertices that it has reached, and a cell that two reach in the
/// same step goes to the one with the lower number. So the regions depend only on the topology and the numbering. Cells
/// that no region reaches are divided by their numbers. Call it inside team.run().
Regions grow_regions(const CellNeighbours& near, std::size_t size, const Team& team);

}  // namespace varimesh
