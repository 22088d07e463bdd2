// What turns the optimised nodes of a cell into the Bernstein coefficients of its Jacobian, in double precision and for
// derivatives: core/validity/bernstein.h has the same for certificates, with every rounding counted.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh {

/// J = det ∇χ is a polynomial (on pyramids after a change of variables). With g_r = ∂χ/∂ξ_r and its cofactors
/// C_0 = g_1 × g_2 and so on, J = Σ over any one r of g_r · C_r, and dJ = Σ_r dg_r · C_r. Coefficients are scaled by
/// multinomials throughout, so that products of polynomials are plain convolutions.
struct CoefficientTable {
  int dimension = 0;
  int size = 0;                                 ///< Coefficients of J.
  std::array<Eigen::MatrixXd, 3> derivative;    ///< Coefficients of g_r from the optimised nodes: size of g_r × nodes.
  std::array<Eigen::Index, 3> cofactor_size{};  ///< Coefficients of C_r.
  /// In 3-D: number in C_r of the product of coefficient i of g_{r+1} and j of g_{r+2}, at [i · size of g_{r+2} + j].
  std::array<std::vector<std::uint16_t>, 3> cross;
  /// Number in J of the product of coefficient i of g_r and j of C_r, at [i · cofactor_size[r] + j].
  std::array<std::vector<std::uint16_t>, 3> product;
  Eigen::VectorXd reciprocal;  ///< What makes Bernstein coefficients of J of scaled ones.

  /// Coefficients of g_r (rows) by component (columns) from the nodes' positions (nodes × dimension).
  using Vectors = std::array<Eigen::MatrixXd, 3>;
  Vectors derivatives(const Eigen::MatrixXd& positions) const;
  /// Those of C_r.
  Vectors cofactors(const Vectors& derivatives) const;
  /// Bernstein coefficients of J.
  Eigen::VectorXd jacobian(const Vectors& derivatives, const Vectors& cofactors) const;
  /// ∂ Bernstein coefficient / ∂ component c of node n, at (coefficient, n · dimension + c), for these nodes of the
  /// cell.
  Eigen::MatrixXd slope(const Vectors& cofactors, const std::vector<int>& nodes) const;
};

/// The table for cells of one shape and order in a mesh of that dimension; made once, kept for ever.
const CoefficientTable& coefficient_table(Shape shape, int order);

}  // namespace varimesh
