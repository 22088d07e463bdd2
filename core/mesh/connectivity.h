// The cell on the other side of each facet, and the nodes that are fixed because they lie on the boundary.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The elements of one dimension, numbered from 0 through the blocks in the mesh's order. Refers to the mesh, whose
/// blocks must outlive it and stay the same.
class Cells {
 public:
  /// @param dimension the dimension of the mesh for cells, one less for boundary elements
  Cells(const HighOrderMesh& mesh, int dimension);

  /// The cells of one block.
  struct Range {
    const ElementBlock* block;
    std::size_t first;   ///< Number of its first cell.
    std::size_t stride;  ///< Nodes per cell.
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

/// What is on the other side of every facet of every cell. The facets of cell c are first[c] … first[c + 1] − 1, in the
/// order of ShapeInfo::facets. `neighbour` and `opposite` have one entry per facet.
struct Facets {
  std::vector<std::int32_t> first;      ///< cells + 1 entries.
  std::vector<std::int32_t> neighbour;  ///< The cell on the other side, or −1 on the boundary.
  std::vector<std::int32_t> opposite;   ///< The index of the same facet in that cell, or −1.
  /// Pairs (facet, element of one dimension less with the same vertices), ordered by facet. These are boundary elements
  /// and elements of interfaces.
  std::vector<std::pair<std::int32_t, std::int32_t>> elements;
  std::int32_t crowded = -1;      ///< The first facet that more than two cells share; −1 if there is none.
  std::size_t crowded_count = 0;  ///< How many such facets there are.
};

/// Finds the facets that cells share: facets with the same vertices in any order are the same. Takes about half a
/// second for a million tetrahedra on one thread.
/// Call it inside team.run().
Facets facets(const HighOrderMesh& mesh, const Team& team = Team(1));

/// How often facets() was called in this process. Tests count with it that nobody finds facets that are known.
std::int64_t facet_searches();

/// Whether each node is fixed: all nodes on facets with one neighbour and on elements of one dimension less, including
/// interfaces. So whole vertices, edges and faces are fixed.
std::vector<bool> fixed_nodes(const HighOrderMesh& mesh);

/// The same for known facets.
std::vector<bool> fixed_nodes(const HighOrderMesh& mesh, const Facets& facets);

}  // namespace varimesh
