// Tables that turn the optimised nodes of a cell into the Bernstein coefficients of its Jacobian and their derivatives.
// They do not bound rounding errors; for certificates, which do, see validity/bernstein.h.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/base/stop_token.h"
#include "core/reference/shape.h"

namespace varimesh {

/// J = det ∇χ is a polynomial (on pyramids after a change of variables). With g_r = ∂χ/∂ξ_r and their cofactors
/// C_0 = g_1 × g_2 and so on, J = g_r · C_r for any one r, and dJ = Σ_r dg_r · C_r. All coefficients are scaled by
/// multinomials, so products of polynomials are plain convolutions.
struct CoefficientTable {
  int dimension = 0;
  int size = 0;                               ///< Coefficients of J.
  std::array<Eigen::MatrixXd, 3> derivative;  ///< From the optimised nodes to coefficients of g_r: size of g_r × nodes.
  std::array<Eigen::Index, 3> cofactor_size{};  ///< Number of coefficients of C_r.
  /// Only in 3-D: number in C_r of the product of coefficient i of g_{r+1} and j of g_{r+2}, at [i · size of g_{r+2} +
  /// j].
  std::array<std::vector<std::uint16_t>, 3> cross;
  /// Number in J of the product of coefficient i of g_r and j of C_r, at [i · cofactor_size[r] + j].
  std::array<std::vector<std::uint16_t>, 3> product;
  Eigen::VectorXd reciprocal;  ///< Factors from scaled coefficients of J to Bernstein coefficients.

  /// By r: coefficients (rows) × components (columns).
  using Vectors = std::array<Eigen::MatrixXd, 3>;
  /// The coefficients of g_r from the positions of the nodes (nodes × dimension).
  Vectors derivatives(const Eigen::MatrixXd& positions) const;
  /// The coefficients of C_r.
  Vectors cofactors(const Vectors& derivatives) const;
  /// The Bernstein coefficients of J.
  Eigen::VectorXd jacobian(const Vectors& derivatives, const Vectors& cofactors) const;
  /// The derivative of each Bernstein coefficient by component c of the n-th of these nodes (local numbers), at
  /// (coefficient, n · dimension + c). Looks at the token, which may be null: a hexahedron of order 10 takes ten
  /// seconds.
  Eigen::MatrixXd slope(const Vectors& cofactors, const std::vector<int>& nodes, const StopToken* stop = nullptr) const;
};

/// The table for cells of this shape and order. It is made once and kept until the program ends.
const CoefficientTable& coefficient_table(Shape shape, int order);

}  // namespace varimesh
