// The nodes of one cell: their positions on the lattice of a block, and in space.
#pragma once

#include <array>
#include <vector>

#include "core/reference/shape.h"
#include "tests/bench/structured/blocks.h"

namespace varimesh::bench {

inline constexpr double kRadius = 0.5;  ///< Of the sphere.

/// The corners of a hexahedron of a block. Corner c is at (c & 1, c >> 1 & 1, c >> 2) along u, v, r.
struct Corners {
  std::array<Point, 8> at;
  bool on_sphere;  ///< Corners 0 to 3 lie on the sphere.
};

/// The node at a lattice point of a straight-sided or blended cell; 0 ≤ local[k] ≤ order. A cell at the sphere is
/// blended: the distance from the chord to the sphere is multiplied by the share s of the corners on the sphere in a
/// hexahedron, and by s² in a tetrahedron, where it is then a polynomial again.
Point node_in_cell(Shape shape, const Corners& corners, const Steps& local, int order);

/// The lattice positions of the nodes of the simplex whose vertices step along these axes, in Gmsh's node order. If
/// `mirrored`, its last two vertices are swapped.
std::vector<Steps> simplex_nodes(Shape shape, const Steps& axes, bool mirrored, int order);

/// The lattice positions of the nodes of a quadrilateral or hexahedron, in Gmsh's node order. If `mirrored`, u and v
/// are swapped.
std::vector<Steps> tensor_nodes(Shape shape, bool mirrored, int order);

}  // namespace varimesh::bench
