// Quadrature with positive weights at points strictly inside the cell.
#pragma once

#include <Eigen/Core>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh::reference {

/// A quadrature rule on the reference cell; the weights sum to ShapeInfo::measure.
struct Quadrature {
  Points points;            ///< points × dimension, row-major.
  Eigen::VectorXd weights;  ///< All positive.
  int degree = 0;           ///< Polynomials up to this total degree are integrated exactly.
};

/// The rule that the optimiser uses for cells of order `order`. It integrates polynomials of degree `degree` exactly.
///   simplices                        the smallest stored symmetric rule; above the tables, a conical product of
///                                    Gauss–Jacobi rules
///   quadrilaterals and hexahedra     tensor Gauss with order + 1 points per direction, or more if `degree` needs them
///   prisms                           the triangle's rule × Gauss
///   pyramids                         a conical product
/// Symmetric rules of the other shapes are not used: with them, some deformations cost no energy.
Quadrature quadrature(Shape shape, int order, int degree);

/// The Gauss–Jacobi rule with n points on [−1, 1] for the weight (1 − x)^a (1 + x)^b: points and weights.
std::pair<Eigen::VectorXd, Eigen::VectorXd> gauss_jacobi(int n, double a, double b);

}  // namespace varimesh::reference
