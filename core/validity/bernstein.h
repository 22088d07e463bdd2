// Tables that turn the nodes of a cell into the Bernstein coefficients of its Jacobian. Internal to core/quality.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// The widest floating-point type at hand: 113 bits, by hardware or software.
#ifdef __SIZEOF_FLOAT128__
using Quad = __float128;
#else
using Quad = long double;
#endif

/// A simplex among those whose product is the cell: a triangle is one 2-simplex, a prism a 2-simplex times a 1-simplex.
struct Factor {
  int dimension = 1;
  int degree = 0;
};

/// Exponents (γ) of the monomials λ^γ, the barycentric coordinates of all factors one behind the other; unused ones 0.
using Exponents = std::array<std::int8_t, 6>;

/// Polynomials on a product of simplices, homogeneous in each factor's barycentric coordinates. A polynomial is held by
/// its Bernstein coefficients b_γ, or scaled as c_γ = multinomial_γ b_γ, the coefficient of λ^γ; scaled coefficients of
/// a product are the plain convolution of those of its factors.
class BernsteinSpace {
 public:
  BernsteinSpace() = default;
  explicit BernsteinSpace(const std::vector<Factor>& factors);

  const std::vector<Factor>& factors() const { return factors_; }
  const std::vector<Exponents>& exponents() const { return exponents_; }
  int size() const { return static_cast<int>(exponents_.size()); }
  /// Number of the monomial with these exponents, −1 where it is not in the space.
  int index(const Exponents& exponents) const;
  /// Product over the factors of degree! / Π γ_k!.
  long double multinomial(int index) const;
  /// Where the exponents of factor f begin.
  int offset(int factor) const;

 private:
  std::vector<Factor> factors_;
  std::vector<Exponents> exponents_;
  std::vector<std::int32_t> lookup_;  // by exponents read as digits
};

/// Pairs (i, j) of coefficients of two polynomials that make coefficient k of their product: those of k are
/// pairs[start[k]] … pairs[start[k + 1] − 1].
struct Convolution {
  std::vector<std::uint32_t> start;
  std::vector<std::array<std::uint16_t, 2>> pairs;
};

/// A scaled coefficient of a derivative: plus_weight · c[plus] − minus_weight · c[minus], weights small integers.
struct Difference {
  std::uint16_t plus = 0, minus = 0;
  double plus_weight = 0, minus_weight = 0;
};

/// Everything that turns the nodes of a cell of one shape and order into Bernstein coefficients of J = det ∇χ:
/// 1. scaled coefficients of χ: a sparse matrix, since those on an edge or face depend on its nodes only;
/// 2. scaled coefficients of its derivatives g_r: differences;
/// 3. J = g_0 · (g_1 × g_2) by two convolutions (in 2-D one), divided by the multinomials.
///
/// On the pyramid the collapsed coordinates u = x/s, v = y/s in [−1, 1], t = (1 + z)/2, s = 1 − t in [0, 1] make χ a
/// polynomial, spanned by u^i v^j s^k with i, j ≤ k ≤ P (the space of A. Johnen, C. Geuzaine, Geometrical validity of
/// curvilinear pyramidal finite elements, J. Comp. Phys. 299, 2015). The chain rule gives
/// J = det(χ_u / s, χ_v / s, χ_t) / 2, and χ_u and χ_v are divisible by s. So J is a polynomial in (u, v, t) too, of
/// degree at most 3P − 1 in u and v and 3P − 3 in t, and its infimum over the pyramid is its minimum over the box: at
/// the apex J has a limit for every direction (u, v). Dividing by s drops the coefficients with s⁰ and lowers the
/// exponent of s by one in the others.
struct JacobianTable {
  Shape shape = Shape::Triangle;
  int order = 1;
  int dimension = 2;
  int nodes = 0;

  BernsteinSpace map;                        ///< of χ
  std::array<BernsteinSpace, 3> derivative;  ///< of g_r
  BernsteinSpace cross;                      ///< of g_1 × g_2 (3-D)
  BernsteinSpace jacobian;                   ///< of J

  std::vector<std::uint32_t> row_start;  ///< conversion matrix by rows (coefficients)
  std::vector<std::uint16_t> column;     ///< nodes
  std::vector<double> value;             ///< relative error at most 16 u of the row's sum of absolute values
  std::vector<Quad> wide_value;          ///< The same entries to 113 bits.

  std::array<std::vector<Difference>, 3> difference;
  std::array<std::vector<double>, 3> derivative_reciprocal;  ///< 1 / multinomial
  Convolution cross_terms, jacobian_terms;
  std::vector<double> jacobian_reciprocal;  ///< 2^−dimension / multinomial
  std::vector<long double> long_jacobian_reciprocal;

  /// Largest over the coefficients of Σ over nodes of |∂ (unscaled coefficient of g_r) / ∂ node|.
  std::array<double, 3> condition{};
  int conversion_roundings = 0;  ///< Most roundings that a scaled coefficient of g_r carries.
  int product_roundings = 0;     ///< Most roundings that a coefficient of J adds to those.

  std::vector<std::uint16_t> corners;            ///< Coefficients that are values of J: at the corners of the product.
  std::vector<std::array<double, 6>> corner_at;  ///< Their barycentric coordinates, factor behind factor.

  /// Largest total degree of J: roundings of one bisection.
  int degree() const;
};

/// The table for a shape and order; made once, kept for ever.
const JacobianTable& jacobian_table(Shape shape, int order);

}  // namespace varimesh::detail
