// Builds the tables: index sets, exact conversion from equispaced nodes, derivatives and products of polynomials.
#include "core/validity/bernstein.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "core/reference/cache.h"
#include "core/reference/nodes.h"
#include "core/validity/nodes_to_bernstein.h"

namespace varimesh::detail {
namespace {

constexpr int kDigit = 32;  // exponents are below 3 kMaxOrder + 1 = 31

long double multinomial_of(const Exponents& exponents, int offset, const Factor& factor) {
  long double result = 1;
  int sum = 0;
  for (int k = 0; k <= factor.dimension; ++k)
    for (int m = 1; m <= exponents[static_cast<std::size_t>(offset + k)]; ++m) result = result * ++sum / m;
  return result;
}

/// Visits all exponents of one factor; the others stay as they are.
template <class Visit>
void each_of_factor(Exponents& exponents, int offset, const Factor& factor, Visit&& visit) {
  const auto fill = [&](auto&& self, int k, int left) -> void {
    if (k == 0) {
      exponents[static_cast<std::size_t>(offset)] = static_cast<std::int8_t>(left);
      visit();
      return;
    }
    for (int e = 0; e <= left; ++e) {
      exponents[static_cast<std::size_t>(offset + k)] = static_cast<std::int8_t>(e);
      self(self, k - 1, left - e);
    }
  };
  fill(fill, factor.dimension, factor.degree);
}

/// Exponents read as the digits of a number. The first of each factor follows from the others and is left out.
std::size_t key(const Exponents& exponents, const std::vector<Factor>& factors) {
  std::size_t result = 0;
  int at = 0;
  for (const Factor& factor : factors) {
    for (int k = 1; k <= factor.dimension; ++k)
      result = result * kDigit + static_cast<std::size_t>(exponents[static_cast<std::size_t>(at + k)]);
    at += factor.dimension + 1;
  }
  return result;
}

/// Factors of a shape with the same degree in each.
std::vector<Factor> factors_of(Shape shape, int degree) {
  switch (shape) {
    case Shape::Triangle:
      return {{2, degree}};
    case Shape::Tetrahedron:
      return {{3, degree}};
    case Shape::Quadrilateral:
      return {{1, degree}, {1, degree}};
    case Shape::Prism:
      return {{2, degree}, {1, degree}};
    case Shape::Pyramid:
    case Shape::Hexahedron:
      return {{1, degree}, {1, degree}, {1, degree}};
    default:
      assert(false && "only cells of dimension 2 and 3 have a Jacobian to bound");
      return {};
  }
}

/// Which factor a direction r belongs to, and which of its barycentric coordinates grows along it.
struct Direction {
  int factor, coordinate;
};

Direction direction_of(Shape shape, int r) {
  switch (shape) {
    case Shape::Triangle:
    case Shape::Tetrahedron:
      return {0, r + 1};
    case Shape::Prism:
      return r < 2 ? Direction{0, r + 1} : Direction{1, 1};
    default:
      return {r, 1};
  }
}

BernsteinSpace product_space(const BernsteinSpace& a, const BernsteinSpace& b) {
  std::vector<Factor> factors = a.factors();
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f].degree += b.factors()[f].degree;
  return BernsteinSpace(factors);
}

Convolution convolution(const BernsteinSpace& a, const BernsteinSpace& b, const BernsteinSpace& product) {
  Convolution result;
  const std::vector<std::size_t> of_a = a.digits(), of_b = b.digits();
  const auto in_product = [&](std::size_t i, std::size_t j) {
    return static_cast<std::size_t>(product.index_of_digits(of_a[i] + of_b[j]));
  };
  result.start.assign(static_cast<std::size_t>(product.size()) + 1, 0);
  for (std::size_t i = 0; i < of_a.size(); ++i)
    for (std::size_t j = 0; j < of_b.size(); ++j) ++result.start[in_product(i, j) + 1];
  std::partial_sum(result.start.begin(), result.start.end(), result.start.begin());
  result.pairs.resize(result.start.back());
  std::vector<std::uint32_t> next(result.start.begin(), result.start.end() - 1);
  for (std::size_t i = 0; i < of_a.size(); ++i)
    for (std::size_t j = 0; j < of_b.size(); ++j)
      result.pairs[next[in_product(i, j)]++] = {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j)};
  return result;
}

int longest(const std::vector<std::uint32_t>& start) {
  std::uint32_t most = 0;
  for (std::size_t i = 0; i + 1 < start.size(); ++i) most = std::max(most, start[i + 1] - start[i]);
  return static_cast<int>(most);
}

// ---------------------------------------------------------------------------------------------------------------------
// The parts of a table
// ---------------------------------------------------------------------------------------------------------------------

void add_conversion(JacobianTable& table) {
  const std::vector<std::vector<Quad>> rows = nodes_to_bernstein(table.shape, table.order, table.map);
  table.nodes = reference::node_count(table.shape, table.order);
  table.row_start.push_back(0);
  for (const std::vector<Quad>& row : rows) {
    for (std::size_t n = 0; n < row.size(); ++n) {
      if (row[n] == 0) continue;
      table.column.push_back(static_cast<std::uint16_t>(n));
      table.value.push_back(static_cast<double>(row[n]));
      table.wide_value.push_back(row[n]);
    }
    table.row_start.push_back(static_cast<std::uint32_t>(table.column.size()));
  }
}

/// Direction r: c'_δ = (δ_k + 1) c_{δ + e_k} − (δ_0 + 1) c_{δ + e_0}, where coordinate k grows. (The factor 2 between
/// the derivatives with respect to λ and to ξ is in jacobian_reciprocal.)
void add_derivative(JacobianTable& table, int r) {
  const auto [factor, coordinate] = direction_of(table.shape, r);
  const bool divided = table.shape == Shape::Pyramid && r < 2;  // by s, the first coordinate of the last factor
  std::vector<Factor> factors = table.map.factors();
  --factors[static_cast<std::size_t>(factor)].degree;
  if (divided) --factors[2].degree;
  BernsteinSpace& space = table.derivative[static_cast<std::size_t>(r)];
  space = BernsteinSpace(factors);
  const auto at = static_cast<std::size_t>(table.map.offset(factor));
  double condition = 0;
  for (int i = 0; i < space.size(); ++i) {
    Exponents exponents = space.exponents()[static_cast<std::size_t>(i)];
    if (divided) ++exponents[static_cast<std::size_t>(table.map.offset(2))];
    Exponents plus = exponents, minus = exponents;
    ++plus[at + static_cast<std::size_t>(coordinate)];
    ++minus[at];
    Difference d;
    d.plus = static_cast<std::uint16_t>(table.map.index(plus));
    d.minus = static_cast<std::uint16_t>(table.map.index(minus));
    d.plus_weight = plus[at + static_cast<std::size_t>(coordinate)];
    d.minus_weight = minus[at];
    table.difference[static_cast<std::size_t>(r)].push_back(d);
    const double reciprocal = static_cast<double>(1 / space.multinomial(i));
    table.derivative_reciprocal[static_cast<std::size_t>(r)].push_back(reciprocal);
    const auto absolute_row = [&](std::size_t row) {
      double sum = 0;
      for (std::uint32_t e = table.row_start[row]; e < table.row_start[row + 1]; ++e) sum += std::abs(table.value[e]);
      return sum;
    };
    condition = std::max(condition,
                         reciprocal * (d.plus_weight * absolute_row(d.plus) + d.minus_weight * absolute_row(d.minus)));
  }
  table.condition[static_cast<std::size_t>(r)] = condition * (1 + 1e-12);
}

void add_products(JacobianTable& table) {
  const auto& [a, b, c] = table.derivative;
  int roundings = 0;
  if (table.dimension == 2) {
    table.jacobian = product_space(a, b);
    table.jacobian_terms = convolution(a, b, table.jacobian);
    roundings = 2 * longest(table.jacobian_terms.start);
  } else {
    table.cross = product_space(b, c);
    table.cross_terms = convolution(b, c, table.cross);
    table.jacobian = product_space(a, table.cross);
    table.jacobian_terms = convolution(a, table.cross, table.jacobian);
    roundings = 2 * longest(table.cross_terms.start) + 3 * longest(table.jacobian_terms.start);
  }
  // Besides the sums there are the products, and two roundings for the multinomial and its reciprocal.
  table.product_roundings = roundings + 8;
  const long double scale = table.dimension == 2 ? 0.25L : 0.125L;
  for (int i = 0; i < table.jacobian.size(); ++i) {
    const long double reciprocal = scale / table.jacobian.multinomial(i);
    table.jacobian_reciprocal.push_back(static_cast<double>(reciprocal));
    table.long_jacobian_reciprocal.push_back(reciprocal);
  }
}

void add_corners(JacobianTable& table) {
  const auto& factors = table.jacobian.factors();
  for (int i = 0; i < table.jacobian.size(); ++i) {
    const Exponents& exponents = table.jacobian.exponents()[static_cast<std::size_t>(i)];
    std::array<double, 6> at{};
    bool corner = true;
    for (std::size_t f = 0; f < factors.size(); ++f) {
      bool full = false;
      for (int k = 0; k <= factors[f].dimension; ++k) {
        const auto slot = static_cast<std::size_t>(table.jacobian.offset(static_cast<int>(f)) + k);
        // J is constant along a factor of degree 0: any of its corners stands for all.
        const bool here = exponents[slot] == factors[f].degree && !full;
        at[slot] = here ? 1 : 0;
        full |= here;
      }
      corner &= full;
    }
    if (!corner) continue;
    table.corners.push_back(static_cast<std::uint16_t>(i));
    table.corner_at.push_back(at);
  }
}

JacobianTable make_table(Shape shape, int order) {
  JacobianTable table;
  table.shape = shape;
  table.order = order;
  table.dimension = reference::info(shape).dimension;
  table.map = BernsteinSpace(factors_of(shape, order));
  add_conversion(table);
  // The table entry, the difference from the first node, the products and sums of a row, then the difference of two
  // rows.
  table.conversion_roundings = longest(table.row_start) + 16 + 1 + 4;
  for (int r = 0; r < table.dimension; ++r) add_derivative(table, r);
  add_products(table);
  add_corners(table);
  return table;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// Spaces
// ---------------------------------------------------------------------------------------------------------------------

BernsteinSpace::BernsteinSpace(const std::vector<Factor>& factors) : factors_(factors) {
  Exponents exponents{};
  const auto nest = [&](auto&& self, std::size_t f) -> void {
    if (f == factors_.size()) {
      exponents_.push_back(exponents);
      return;
    }
    each_of_factor(exponents, offset(static_cast<int>(f)), factors_[f], [&] { self(self, f + 1); });
  };
  nest(nest, 0);
  std::size_t most = 0;
  for (const Exponents& e : exponents_) most = std::max(most, key(e, factors_));
  lookup_.assign(most + 1, -1);
  for (std::size_t i = 0; i < exponents_.size(); ++i) lookup_[key(exponents_[i], factors_)] = static_cast<int>(i);
}

int BernsteinSpace::index(const Exponents& exponents) const { return index_of_digits(key(exponents, factors_)); }

std::vector<std::size_t> BernsteinSpace::digits() const {
  std::vector<std::size_t> result;
  result.reserve(exponents_.size());
  for (const Exponents& exponents : exponents_) result.push_back(key(exponents, factors_));
  return result;
}

int BernsteinSpace::offset(int factor) const {
  int at = 0;
  for (int f = 0; f < factor; ++f) at += factors_[static_cast<std::size_t>(f)].dimension + 1;
  return at;
}

long double BernsteinSpace::multinomial(int index) const {
  long double result = 1;
  for (std::size_t f = 0; f < factors_.size(); ++f)
    result *= multinomial_of(exponents_[static_cast<std::size_t>(index)], offset(static_cast<int>(f)), factors_[f]);
  return result;
}

int JacobianTable::degree() const {
  int degree = 0;
  for (const Factor& factor : jacobian.factors()) degree = std::max(degree, factor.degree);
  return degree;
}

const JacobianTable& jacobian_table(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, JacobianTable> cache;
  return cache.get(std::pair(shape, order), [&] { return make_table(shape, order); });
}

}  // namespace varimesh::detail
