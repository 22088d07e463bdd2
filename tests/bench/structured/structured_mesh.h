// Meshes of any size and order for measurements, made in seconds and without a mesh generator.
#pragma once

#include <cstdint>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::bench {

/// What to make, and how far it is disturbed.
struct StructuredMesh {
  Shape shape = Shape::Tetrahedron;  ///< Tetrahedron or Hexahedron.
  int order = 4;                     ///< 1 to kMaxOrder.
  std::int64_t elements = 30'000;    ///< Wanted number of cells. The mesh has about as many.
  /// How far a free vertex is moved: at most this share of the shortest edge at the vertex.
  /// At 0.12, the flattest of a million tetrahedra has a mean ratio of 0.19, and the smallest scaled Jacobian of a
  /// million hexahedra is 0.19. At 0.15 these are 0.11 and 0.05.
  double vertex_shift = 0.12;
  /// How far any other free node is moved: at most this share of the distance between the nodes of the
  /// shortest edge of its cell.
  double node_shift = 0;
};

/// The numbers of hexahedra along the edges of the six blocks of a cube with a hole. A block with n × n × m hexahedra
/// lies between a face of the cube and its part of the sphere.
struct BlockCounts {
  int along = 0;   ///< n: along each edge of the cube.
  int radial = 0;  ///< m: from the sphere to the cube.
};

/// The counts that come closest to the wanted number of cells with m ≈ 2 n / 3, so that cells of meshes of all sizes
/// have about the same shapes. From 30,000 cells on, the number is met to within 5 %. A hexahedron is split into
/// `cells_each` cells.
BlockCounts block_counts(std::int64_t elements, int cells_each);

/// A cube [−1, 1]³ with a spherical hole of radius ½ around its centre. Edges are about 2.5 times as long at the cube
/// as at the sphere. Tetrahedra are made from hexahedra, six from each, by Kuhn's split along one diagonal; in all
/// blocks the split follows the axes x, y and z, so that neighbouring blocks conform.
///
/// The nodes are placed as a mesh generator leaves them:
///   - all nodes on the sphere lie exactly on it, to rounding
///   - cells with a curved face or edge are blended to it; their edges that leave the sphere are straight
///   - all other cells are straight-sided
///   - free vertices are shifted at random. The numbers come from a hash, so they are the same on every machine.
/// Every cell is valid from the start. What there is to optimise is the curvature at the sphere, as in a real mesh.
///
/// Nodes are numbered layer by layer from the sphere outwards, cells block by block. The mesh has the physical groups
/// "solid" (3-D), "sphere" and "cube" (2-D). Errors: BadOption.
Expected<HighOrderMesh> cube_with_hole(const StructuredMesh& wanted);

/// The square [0, 1]² with cells × cells quadrilaterals of order 1. Free vertices are shifted at random
/// by at most `shift` of an edge's length. Up to 0.25, every cell stays convex. Errors: BadOption.
Expected<HighOrderMesh> perturbed_square(int cells, double shift = 0.2);

}  // namespace varimesh::bench
