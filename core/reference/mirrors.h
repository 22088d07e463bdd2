// The mirrors of a reference cell.
#pragma once

#include <Eigen/Core>

#include "core/reference/shape.h"

namespace varimesh::reference {

/// Coordinates s of a cell in which its mirrors are changes of sign: ξ = origin + Σ s_α τ_α, and for every α < count
/// the map that turns s_α into −s_α and leaves the others takes the cell to itself. On a simplex such a map swaps two
/// vertices, in a tensor direction its ends.
struct Mirrors {
  int count = 0;               ///< Of mirrors, at most the dimension.
  Eigen::VectorXd origin;      ///< Reference coordinates of s = 0.
  Eigen::MatrixXd directions;  ///< Row α: τ_α in reference coordinates.
};

/// Of a cell of dimension 2 or 3: one mirror of a triangle, two of a quadrilateral, a tetrahedron, a prism and a
/// pyramid, three of a hexahedron.
Mirrors mirrors(Shape shape);

}  // namespace varimesh::reference
