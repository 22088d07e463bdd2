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
  int degree = 0;           ///< Polynomials of this total degree are integrated exactly.
};

/// The rule the optimiser uses for cells of order `order`: on simplices the smallest stored symmetric rule of at least
/// `degree` (a conical product of Gauss–Jacobi rules above the tables); on quadrilaterals and hexahedra tensor Gauss
/// with order + 1 points a direction (more where `degree` asks for it); on prisms the triangle's rule × Gauss; on
/// pyramids a conical product. The symmetric rules of the other shapes leave modes that cost no energy.
Quadrature quadrature(Shape shape, int order, int degree);

/// Gauss–Jacobi rule of n points on [−1, 1] for the weight (1 − x)^a (1 + x)^b: points, weights.
std::pair<Eigen::VectorXd, Eigen::VectorXd> gauss_jacobi(int n, double a, double b);

}  // namespace varimesh::reference
