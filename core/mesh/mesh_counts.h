// How many vertices, edges, faces and cells a mesh has, of any order: what the memory of a run is estimated from.
#pragma once

#include <array>
#include <cstdint>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Numbers of the places that nodes lie in.
struct Places {
  std::int64_t vertices = 0, edges = 0;
  std::int64_t triangles = 0, quadrilaterals = 0;  ///< Faces of cells in 3-D.
  std::array<std::int64_t, kShapes> cells{};       ///< Interiors of cells, by shape.

  /// The nodes that lie in these places in a mesh of this order.
  std::int64_t nodes(int order) const;
};

/// The counts of a mesh from which the memory of a run follows. They are exact for the mesh's own order, if the file
/// has its boundary elements. Edges and faces without nodes of their own are counted by Euler's formula.
struct MeshCounts {
  int dimension = 0;
  int order = 0;                               ///< The order in which the mesh is optimised.
  std::array<std::int64_t, kShapes> cells{};   ///< By shape.
  std::array<std::int64_t, kShapes> others{};  ///< Elements of lower dimension, by shape.
  std::int64_t unused = 0;                     ///< Nodes that no cell has.
  Places all;
  Places free;           ///< Those whose nodes are not on elements of one dimension less, nor on the outer boundary.
  Places free_in_cells;  ///< The free ones of every cell, added up: a place of three cells counts three times.
  /// By q = 1 and 2: ordered pairs of different free nodes of a mesh of order q that share a cell.
  std::array<std::int64_t, 3> neighbours{};

  std::int64_t cell_count() const;
  std::int64_t nodes() const { return all.nodes(order) + unused; }
  std::int64_t free_nodes() const { return free.nodes(order); }
};

/// Counts a mesh that is to be optimised in this order. Takes two bits per node while it counts.
MeshCounts count(const HighOrderMesh& mesh, int order);

/// The bytes of a mesh with these counts.
std::int64_t bytes_of_mesh(const MeshCounts& counts);

/// The most bytes that check_structure() has in use.
std::int64_t bytes_of_check(const MeshCounts& counts);

}  // namespace varimesh
