// Expands the Lagrange polynomials of equispaced nodes in Bernstein polynomials, shape by shape.
#include "core/validity/nodes_to_bernstein.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <map>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Matrix = std::vector<std::vector<Quad>>;

Matrix zero_matrix(int rows, int columns) {
  return Matrix(static_cast<std::size_t>(rows), std::vector<Quad>(static_cast<std::size_t>(columns), Quad(0)));
}

Quad magnitude(Quad x) { return x < 0 ? -x : x; }

// ---------------------------------------------------------------------------------------------------------------------
// Simplices, and products of them
// ---------------------------------------------------------------------------------------------------------------------

/// polynomial × (form · λ), both homogeneous: the degree rises by one.
std::vector<std::int64_t> times_form(const std::vector<std::int64_t>& polynomial, const BernsteinSpace& from,
                                     const BernsteinSpace& to, const std::array<std::int64_t, 4>& form) {
  const int corners = from.factors()[0].dimension + 1;
  std::vector<std::int64_t> result(static_cast<std::size_t>(to.size()), 0);
  for (int i = 0; i < from.size(); ++i) {
    for (int k = 0; k < corners; ++k) {
      Exponents exponents = from.exponents()[static_cast<std::size_t>(i)];
      ++exponents[static_cast<std::size_t>(k)];
      result[static_cast<std::size_t>(to.index(exponents))] +=
          form[static_cast<std::size_t>(k)] * polynomial[static_cast<std::size_t>(i)];
    }
  }
  return result;
}

/// BernsteinSpace({{dimension, degree}}) for the degrees from 0 to `order`.
std::vector<BernsteinSpace> simplex_spaces(int dimension, int order) {
  std::vector<BernsteinSpace> spaces;
  for (int degree = 0; degree <= order; ++degree) spaces.emplace_back(std::vector<Factor>{{dimension, degree}});
  return spaces;
}

/// Scaled coefficients of the Lagrange polynomial of the node α on the simplex of that dimension, in the order of
/// spaces[order]. `spaces` are those of simplex_spaces().
std::vector<Quad> lagrange_on_simplex(const std::vector<BernsteinSpace>& spaces, int order, const Exponents& alpha) {
  const int dimension = spaces[0].factors()[0].dimension;
  std::vector<std::int64_t> polynomial{1};
  std::int64_t denominator = 1;
  int degree = 0;
  for (int k = 0; k <= dimension; ++k) {
    for (int m = 0; m < alpha[static_cast<std::size_t>(k)]; ++m) {
      std::array<std::int64_t, 4> form;
      form.fill(-m);
      form[static_cast<std::size_t>(k)] = order - m;
      const auto at = static_cast<std::size_t>(degree++);
      polynomial = times_form(polynomial, spaces[at], spaces[at + 1], form);
      denominator *= m + 1;
    }
  }
  assert(degree == order);
  std::vector<Quad> result;
  for (const std::int64_t numerator : polynomial)
    result.push_back(static_cast<Quad>(numerator) / static_cast<Quad>(denominator));
  return result;
}

/// The conversion on one simplex: one row per coefficient, one column per lattice position, both in the space's order.
Matrix simplex_conversion(int dimension, int order) {
  const std::vector<BernsteinSpace> spaces = simplex_spaces(dimension, order);
  const BernsteinSpace& space = spaces.back();
  Matrix result = zero_matrix(space.size(), space.size());
  for (int node = 0; node < space.size(); ++node) {
    const auto column = lagrange_on_simplex(spaces, order, space.exponents()[static_cast<std::size_t>(node)]);
    for (int row = 0; row < space.size(); ++row)
      result[static_cast<std::size_t>(row)][static_cast<std::size_t>(node)] = column[static_cast<std::size_t>(row)];
  }
  return result;
}

/// The exponents of factor f only, as those of a space with one factor.
Exponents of_factor(const Exponents& exponents, const BernsteinSpace& space, std::size_t f) {
  Exponents result{};
  const int offset = space.offset(static_cast<int>(f));
  for (int k = 0; k <= space.factors()[f].dimension; ++k)
    result[static_cast<std::size_t>(k)] = exponents[static_cast<std::size_t>(offset + k)];
  return result;
}

/// Lattice position (i, j, k) of a node as exponents. The first of each factor is what the others leave of the order.
Exponents node_exponents(const std::array<std::int8_t, 3>& position, const BernsteinSpace& space, int order) {
  Exponents result{};
  std::size_t direction = 0;
  for (std::size_t f = 0; f < space.factors().size(); ++f) {
    const auto offset = static_cast<std::size_t>(space.offset(static_cast<int>(f)));
    int left = order;
    for (int k = 1; k <= space.factors()[f].dimension; ++k, ++direction) {
      result[offset + static_cast<std::size_t>(k)] = position[direction];
      left -= position[direction];
    }
    result[offset] = static_cast<std::int8_t>(left);
  }
  return result;
}

Matrix product_conversion(Shape shape, int order, const BernsteinSpace& space) {
  const auto& lattice = reference::lattice(shape, order);
  std::vector<Matrix> parts;
  std::vector<BernsteinSpace> part_spaces;
  for (const Factor& factor : space.factors()) {
    parts.push_back(simplex_conversion(factor.dimension, order));
    part_spaces.emplace_back(std::vector<Factor>{{factor.dimension, order}});
  }
  using Indices = std::array<std::size_t, 3>;  // in the space of each factor
  const auto indices_of = [&](const Exponents& exponents) {
    Indices indices{};
    for (std::size_t f = 0; f < parts.size(); ++f)
      indices[f] = static_cast<std::size_t>(part_spaces[f].index(of_factor(exponents, space, f)));
    return indices;
  };
  std::vector<Indices> of_node;
  for (const auto& position : lattice) of_node.push_back(indices_of(node_exponents(position, space, order)));
  Matrix result = zero_matrix(space.size(), static_cast<int>(lattice.size()));
  for (std::size_t row = 0; row < result.size(); ++row) {
    const Indices of_row = indices_of(space.exponents()[row]);
    for (std::size_t node = 0; node < lattice.size(); ++node) {
      Quad value = parts[0][of_row[0]][of_node[node][0]];
      for (std::size_t f = 1; f < parts.size() && value != 0; ++f) value *= parts[f][of_row[f]][of_node[node][f]];
      result[row][node] = value;
    }
  }
  return result;
}

// ---------------------------------------------------------------------------------------------------------------------
// Pyramids
// ---------------------------------------------------------------------------------------------------------------------

/// Scaled coefficients (by exponent of the second coordinate) of a univariate polynomial, times (a λ_0 + b λ_1).
std::vector<Quad> times_line(const std::vector<Quad>& polynomial, Quad a, Quad b) {
  std::vector<Quad> result(polynomial.size() + 1, Quad(0));
  for (std::size_t e = 0; e < polynomial.size(); ++e) {
    result[e] += a * polynomial[e];
    result[e + 1] += b * polynomial[e];
  }
  return result;
}

/// The pyramid's layer with n intervals per edge (s = n/P) has (n + 1)² nodes. The space is spanned by
/// q_m(u, v) s^m Π_{n > m} (s − n/P), m = 0 … P, with q_m of degree m in u and in v. The m-th kind vanishes on all
/// layers finer than its own, so the layers can be interpolated one after another, from the base up.
class PyramidConversion {
 public:
  explicit PyramidConversion(int order) : order_(order) {
    for (int m = 0; m <= order; ++m) {
      height_.push_back(height(m));
      elevated_.push_back(elevated(m));
      evaluation_.emplace_back(1);
      for (int n = 1; n < m; ++n) evaluation_.back().push_back(evaluation(m, n));
    }
  }

  /// Adds the coefficients of the Lagrange polynomial of node (i, j) of the layer with n intervals to column `node`.
  void column(int n, int i, int j, std::size_t node, const BernsteinSpace& space, Matrix& result) const {
    std::vector<Matrix> residual;
    for (int m = 0; m <= n; ++m) residual.push_back(zero_matrix(m + 1, m + 1));
    residual[static_cast<std::size_t>(n)][static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = 1;
    for (int m = n; m >= 0; --m) {
      const Matrix& q = residual[static_cast<std::size_t>(m)];
      for (int coarser = 1; coarser < m; ++coarser)
        subtract(q, m, coarser, residual[static_cast<std::size_t>(coarser)]);
      add(q, m, node, space, result);
    }
  }

 private:
  /// s^m Π_{n > m} (s − n/P), scaled to be 1 on its own layer, as scaled coefficients by the exponent of t = 1 − s.
  std::vector<Quad> height(int m) const {
    std::vector<Quad> result{Quad(1)};
    const Quad P = order_;
    for (int k = 0; k < m; ++k) result = times_line(result, m == 0 ? Quad(1) : P / m, 0);
    for (int n = m + 1; n <= order_; ++n)
      result = times_line(result, (1 - n / P) / ((m - n) / P), (-n / P) / ((m - n) / P));
    return result;
  }

  /// Its value on the layer with n intervals.
  Quad height_at(int m, int n) const {
    Quad result = 1;
    for (int k = 0; k < m; ++k) result *= Quad(n) / m;
    for (int k = m + 1; k <= order_; ++k) result *= Quad(n - k) / Quad(m - k);
    return result;
  }

  /// Scaled coefficients of degree P of the univariate Lagrange polynomials on m intervals: (P + 1) × (m + 1).
  Matrix elevated(int m) const {
    Matrix result = zero_matrix(order_ + 1, m + 1);
    const std::vector<BernsteinSpace> spaces = simplex_spaces(1, m);
    const BernsteinSpace& space = spaces.back();
    for (int node = 0; node <= m; ++node) {
      const Exponents alpha{static_cast<std::int8_t>(m - node), static_cast<std::int8_t>(node)};
      const std::vector<Quad> scaled = lagrange_on_simplex(spaces, m, alpha);
      std::vector<Quad> polynomial(static_cast<std::size_t>(m) + 1);
      for (int e = 0; e <= m; ++e)
        polynomial[static_cast<std::size_t>(e)] = scaled[static_cast<std::size_t>(
            space.index({static_cast<std::int8_t>(m - e), static_cast<std::int8_t>(e)}))];
      for (int degree = m; degree < order_; ++degree) polynomial = times_line(polynomial, 1, 1);
      for (std::size_t e = 0; e < polynomial.size(); ++e) result[e][static_cast<std::size_t>(node)] = polynomial[e];
    }
    return result;
  }

  /// Value at x ∈ [0, 1] of the Lagrange polynomial of `node` on m intervals.
  static Quad lagrange(int m, int node, Quad x) {
    Quad value = 1;
    for (int k = 0; k <= m; ++k)
      if (k != node) value *= (m * x - k) / Quad(node - k);
    return value;
  }

  /// Values on n intervals of the univariate Lagrange polynomials on m intervals: (n + 1) × (m + 1).
  static Matrix evaluation(int m, int n) {
    Matrix result = zero_matrix(n + 1, m + 1);
    for (int a = 0; a <= n; ++a)
      for (int i = 0; i <= m; ++i)
        result[static_cast<std::size_t>(a)][static_cast<std::size_t>(i)] = lagrange(m, i, Quad(a) / n);
    return result;
  }

  /// Adds `factor` times a row to another. Many entries are zero, and products of 113 bits are slow.
  static void add_row(Quad factor, const std::vector<Quad>& row, std::vector<Quad>& sum) {
    if (factor == 0) return;
    for (std::size_t j = 0; j < row.size(); ++j)
      if (row[j] != 0) sum[j] += factor * row[j];
  }

  /// Subtracts from a coarser layer what the m-th kind has there if its values on its own layer are q.
  void subtract(const Matrix& q, int m, int coarser, Matrix& residual) const {
    const Quad factor = height_at(m, coarser);
    const Matrix& at = evaluation_[static_cast<std::size_t>(m)][static_cast<std::size_t>(coarser)];
    Matrix half = zero_matrix(coarser + 1, m + 1);
    for (std::size_t a = 0; a < half.size(); ++a)
      for (std::size_t i = 0; i < q.size(); ++i) add_row(factor * at[a][i], q[i], half[a]);
    for (std::size_t a = 0; a < half.size(); ++a)
      for (std::size_t j = 0; j < q.size(); ++j) {
        if (half[a][j] == 0) continue;
        for (std::size_t b = 0; b < half.size(); ++b) residual[a][b] -= half[a][j] * at[b][j];
      }
  }

  /// Adds the coefficients of the m-th kind with values q on its own layer to column `node`.
  void add(const Matrix& q, int m, std::size_t node, const BernsteinSpace& space, Matrix& result) const {
    const auto n = static_cast<std::size_t>(order_) + 1;
    const Matrix& up = elevated_[static_cast<std::size_t>(m)];
    Matrix half = zero_matrix(order_ + 1, m + 1), both = zero_matrix(order_ + 1, order_ + 1);
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t i = 0; i < q.size(); ++i) add_row(up[a][i], q[i], half[a]);
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t j = 0; j < q.size(); ++j) {
        if (half[a][j] == 0) continue;
        for (std::size_t b = 0; b < n; ++b) both[a][b] += half[a][j] * up[b][j];
      }
    for (int row = 0; row < space.size(); ++row) {
      const Exponents& e = space.exponents()[static_cast<std::size_t>(row)];
      const Quad scale = height_[static_cast<std::size_t>(m)][static_cast<std::size_t>(e[5])];
      if (scale == 0) continue;  // s^m divides it
      result[static_cast<std::size_t>(row)][node] +=
          scale * both[static_cast<std::size_t>(e[1])][static_cast<std::size_t>(e[3])];
    }
  }

  int order_;
  std::vector<std::vector<Quad>> height_;
  std::vector<Matrix> elevated_;
  std::vector<std::vector<Matrix>> evaluation_;  // by m, and by the intervals of the coarser layer
};

/// The square of a layer has eight symmetries. A node (i, j) of the layer with n intervals is the image of one with
/// j ≤ i ≤ n / 2, and so is its Lagrange polynomial.
class LayerSymmetry {
 public:
  LayerSymmetry(int n, int i, int j)
      : first_(std::min(i, n - i)), second_(std::min(j, n - j)), mirrored_{i > n - i, j > n - j} {
    swapped_ = first_ < second_;
    if (swapped_) std::swap(first_, second_);
  }

  /// The node with j ≤ i ≤ n / 2.
  int first() const { return first_; }
  int second() const { return second_; }

  /// The exponents whose coefficient in the polynomial of the node (first, second) is that of `exponents` in the
  /// polynomial of (i, j).
  Exponents source(Exponents exponents) const {
    if (mirrored_[0]) std::swap(exponents[0], exponents[1]);
    if (mirrored_[1]) std::swap(exponents[2], exponents[3]);
    if (swapped_) {
      std::swap(exponents[0], exponents[2]);
      std::swap(exponents[1], exponents[3]);
    }
    return exponents;
  }

 private:
  int first_, second_;
  std::array<bool, 2> mirrored_;
  bool swapped_ = false;
};

Matrix pyramid_conversion(int order, const BernsteinSpace& space) {
  const auto& lattice = reference::lattice(Shape::Pyramid, order);
  const PyramidConversion conversion(order);
  Matrix result = zero_matrix(space.size(), static_cast<int>(lattice.size()));
  std::map<std::array<int, 3>, std::size_t> computed;  // the nodes (n, i, j) with j ≤ i ≤ n / 2
  for (std::size_t node = 0; node < lattice.size(); ++node) {
    const int n = order - lattice[node][2], i = lattice[node][0], j = lattice[node][1];
    if (j > i || 2 * i > n) continue;
    conversion.column(n, i, j, node, space, result);
    computed[{n, i, j}] = node;
  }
  for (std::size_t node = 0; node < lattice.size(); ++node) {
    const int n = order - lattice[node][2];
    const LayerSymmetry symmetry(n, lattice[node][0], lattice[node][1]);
    const std::size_t source = computed.at({n, symmetry.first(), symmetry.second()});
    if (source == node) continue;
    for (std::size_t row = 0; row < result.size(); ++row)
      result[row][node] =
          result[static_cast<std::size_t>(space.index(symmetry.source(space.exponents()[row])))][source];
  }
  // Entries that are zero in exact arithmetic are below 1e-30 here; the smallest other entry is above 1e-10.
  for (std::vector<Quad>& row : result)
    for (Quad& entry : row)
      if (magnitude(entry) < Quad(1e-20)) entry = 0;
  return result;
}

}  // namespace

std::vector<std::vector<Quad>> nodes_to_bernstein(Shape shape, int order, const BernsteinSpace& space) {
  return shape == Shape::Pyramid ? pyramid_conversion(order, space) : product_conversion(shape, order, space);
}

}  // namespace varimesh::detail
