// The mirror symmetries of a reference cell.
#pragma once

#include <Eigen/Core>

#include "core/reference/shape.h"

namespace varimesh::reference {

/// Coordinates s of a cell in which each mirror is a change of sign: ξ = origin + Σ s_α τ_α. For every α < count, the
/// map that replaces s_α by −s_α and keeps the other coordinates maps the cell to itself. On a simplex such a map swaps
/// two vertices; in a tensor direction it swaps the two ends.
struct Mirrors {
  int count = 0;               ///< The number of mirrors, at most the dimension.
  Eigen::VectorXd origin;      ///< Reference coordinates of s = 0.
  Eigen::MatrixXd directions;  ///< dimension × dimension; row α is τ_α in reference coordinates.
};

/// The mirrors of a cell of dimension 2 or 3. A triangle has one; a quadrilateral, a tetrahedron, a prism and a pyramid
/// have two; a hexahedron has three.
Mirrors mirrors(Shape shape);

}  // namespace varimesh::reference
