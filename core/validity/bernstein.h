// Tables that turn the nodes of a cell into the Bernstein coefficients of its Jacobian. Internal to the library.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// The widest available floating-point type: 113 bits, in hardware or software.
#ifdef __SIZEOF_FLOAT128__
using Quad = __float128;
#else
using Quad = long double;
#endif

/// One of the simplices whose product is the cell: a triangle is one 2-simplex, a prism a 2-simplex times a 1-simplex.
struct Factor {
  int dimension = 1;
  int degree = 0;
};

/// Exponents γ of a monomial λ^γ: those of the barycentric coordinates of all factors, one factor after the other.
/// Unused ones are 0.
using Exponents = std::array<std::int8_t, 6>;

/// Polynomials on a product of simplices, homogeneous in each factor's barycentric coordinates. A polynomial is given
/// by its Bernstein coefficients b_γ, or by its scaled coefficients c_γ = multinomial_γ b_γ, the coefficients of λ^γ.
/// The scaled coefficients of a product are the convolution of those of its factors.
class BernsteinSpace {
 public:
  BernsteinSpace() = default;
  explicit BernsteinSpace(const std::vector<Factor>& factors);

  const std::vector<Factor>& factors() const { return factors_; }
  const std::vector<Exponents>& exponents() const { return exponents_; }
  int size() const { return static_cast<int>(exponents_.size()); }
  /// Number of the monomial with these exponents, which must add up to the degree of each factor.
  int index(const Exponents& exponents) const;
  /// The exponents of each monomial, read as the digits of one number. The number of a product of two
  /// monomials, whose spaces differ only in the degrees of their factors, is the sum of the two numbers.
  std::vector<std::size_t> digits() const;
  /// Number of the monomial whose exponents have these digits; −1 if there is none.
  int index_of_digits(std::size_t digits) const { return digits < lookup_.size() ? lookup_[digits] : -1; }
  /// Product over the factors of degree! / Π γ_k!.
  long double multinomial(int index) const;
  /// The slot in Exponents where those of a factor begin.
  int offset(int factor) const;

 private:
  std::vector<Factor> factors_;
  std::vector<Exponents> exponents_;
  std::vector<std::int32_t> lookup_;  // by exponents read as digits
};

/// Which pairs (i, j) of coefficients of two polynomials contribute to coefficient k of their product:
/// pairs[start[k]] … pairs[start[k + 1] − 1].
struct Convolution {
  std::vector<std::uint32_t> start;
  std::vector<std::array<std::uint16_t, 2>> pairs;
};

/// A scaled coefficient of a derivative: plus_weight · c[plus] − minus_weight · c[minus]. The weights are small
/// integers.
struct Difference {
  std::uint16_t plus = 0, minus = 0;
  double plus_weight = 0, minus_weight = 0;
};

/// Everything that turns the nodes of a cell of one shape and order into Bernstein coefficients of J = det ∇χ:
/// 1. scaled coefficients of χ: a sparse matrix, because those on an edge or face depend on its nodes only;
/// 2. scaled coefficients of its derivatives g_r: differences;
/// 3. J = g_0 · (g_1 × g_2) by two convolutions (in 2-D by one), divided by the multinomials.
///
/// On the pyramid the collapsed coordinates u = x/s, v = y/s in [−1, 1], t = (1 + z)/2, s = 1 − t in [0, 1] make χ a
/// polynomial. It is spanned by u^i v^j s^k with i, j ≤ k ≤ P (the space of A. Johnen, C. Geuzaine, Geometrical
/// validity of curvilinear pyramidal finite elements, J. Comp. Phys. 299, 2015). The chain rule gives J = det(χ_u / s,
/// χ_v / s, χ_t) / 2, and χ_u and χ_v are divisible by s. So J is a polynomial in (u, v, t) too, of degree at most 3P −
/// 1 in u and v and 3P − 3 in t, and its infimum over the pyramid is its minimum over the box: at the apex J has a
/// limit for every direction (u, v). Dividing by s drops the coefficients with s⁰ and lowers the exponent of s by one
/// in the others.
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
  std::vector<double> value;             ///< error at most 16 u times the row's sum of absolute values
  std::vector<Quad> wide_value;          ///< the same entries to 113 bits

  std::array<std::vector<Difference>, 3> difference;
  std::array<std::vector<double>, 3> derivative_reciprocal;  ///< 1 / multinomial
  Convolution cross_terms, jacobian_terms;
  std::vector<double> jacobian_reciprocal;  ///< 2^−dimension / multinomial
  std::vector<long double> long_jacobian_reciprocal;

  /// K_r of rounding_bound-inl.h: the largest value over the coefficients of Σ over nodes of |∂ (unscaled coefficient
  /// of g_r) / ∂ node|.
  std::array<double, 3> condition{};
  int conversion_roundings = 0;  ///< The most roundings behind a scaled coefficient of g_r.
  int product_roundings = 0;     ///< The most that a coefficient of J adds to those.

  std::vector<std::uint16_t> corners;            ///< Coefficients that are values of J, at the corners of the product.
  std::vector<std::array<double, 6>> corner_at;  ///< Their barycentric coordinates, one factor after the other.

  /// The largest degree of J in a factor: the number of roundings in one bisection.
  int degree() const;
};

/// The table for a shape and order. It is made once and kept until the program ends.
const JacobianTable& jacobian_table(Shape shape, int order);

}  // namespace varimesh::detail
