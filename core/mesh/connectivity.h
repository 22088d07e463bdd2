// Which cell lies on the other side of each facet, and which nodes the boundary holds fixed.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The elements of one dimension, numbered from 0 through the blocks in the mesh's order. Refers to the mesh, which
/// must outlive it and keep its blocks.
class Cells {
 public:
  /// @param dimension the mesh's own for the cells that are optimised, one less for boundary elements
  Cells(const HighOrderMesh& mesh, int dimension);

  /// Consecutive cells of one block.
  struct Range {
    const ElementBlock* block;
    std::size_t first;   ///< Number of its first cell.
    std::size_t stride;  ///< Nodes a cell.
  };

  std::size_t count() const { return count_; }
  std::span<const Range> ranges() const { return ranges_; }
  const Range& range_of(std::size_t cell) const;
  Shape shape(std::size_t cell) const { return range_of(cell).block->shape; }
  std::span<const std::int32_t> nodes(std::size_t cell) const;
  /// The element's number in the file.
  std::int64_t number(std::size_t cell) const;

 private:
  std::vector<Range> ranges_;
  std::size_t count_ = 0;
};

/// For every facet of every cell what is on its other side. The facets of cell c are first[c] … first[c + 1] − 1, in
/// the order of ShapeInfo::facets; flat arrays, one entry a facet.
struct Facets {
  std::vector<std::int32_t> first;      ///< cells + 1 entries.
  std::vector<std::int32_t> neighbour;  ///< The cell on the other side, or −1 on the boundary.
  std::vector<std::int32_t> opposite;   ///< That cell's facet (index into these arrays), or −1.
  /// (facet, element of one dimension less with the same vertices), by facet: boundary elements and interfaces.
  std::vector<std::pair<std::int32_t, std::int32_t>> elements;
  std::int32_t crowded = -1;      ///< A facet that more than two cells have; −1 where the cells conform.
  std::size_t crowded_count = 0;  ///< How many there are.
};

/// Facets with the same vertices are one, whatever their order. Takes about half a second for a million tetrahedra.
Facets facets(const HighOrderMesh& mesh);

/// For every node whether it is fixed: the nodes on facets with one neighbour and on every element of one dimension
/// less (interfaces too). All nodes of such a facet are fixed, so whole vertices, edges and faces are.
std::vector<bool> fixed_nodes(const HighOrderMesh& mesh);

/// The same where the facets are known.
std::vector<bool> fixed_nodes(const HighOrderMesh& mesh, const Facets& facets);

}  // namespace varimesh
