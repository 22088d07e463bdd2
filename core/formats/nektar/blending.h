// The interior that Nektar++ makes for a face or a cell from its curved boundary. Internal to core/formats.
//
// Source: G. Karniadakis, S. Sherwin, Spectral/hp Element Methods for Computational Fluid Dynamics, 2nd edition, 2005,
// sections 3.1 and 3.2: the modified principal functions. A Nektar++ geometry has coefficients for the vertices, edges
// and faces, and zero for the functions of the interior. On a simplex these functions depend on the order of its
// vertices, because coordinates collapse towards the last one.
#pragma once

#include <Eigen/Core>
#include <span>

#include "core/reference/shape.h"

namespace varimesh::formats {

struct NektarBlending {
  Eigen::MatrixXd inside;  ///< Values at the inner nodes from those at the nodes of the boundary, in Gmsh's order.
  /// Coefficients of functions that VariMesh's cell of this order does not have, from the values at the nodes of the
  /// boundary. Only pyramids of order 3 and above have such functions: those of a curved base.
  Eigen::MatrixXd outside;
};

/// For equispaced nodes. The vertices of triangles, tetrahedra, pyramids and hexahedra have Nektar++'s order. Prisms
/// are in the order of kNektarPrism.
const NektarBlending& nektar_blending(Shape shape, int order);

}  // namespace varimesh::formats
