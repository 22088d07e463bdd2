#include "core/validity/cell_coefficients.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/validity/formulas/rounding_bound-inl.h"
#include "core/validity/rounding.h"

namespace varimesh::detail {
namespace {

/// The two arithmetics. Products are in Real, the conversion of the nodes in Wide.
struct Plain {
  using Real = double;
  using Wide = double;
  static constexpr double kWideUnit = std::numeric_limits<double>::epsilon() / 2;
  static const std::vector<double>& conversion(const JacobianTable& table) { return table.value; }
  static double reciprocal(const JacobianTable& table, std::size_t k) { return table.jacobian_reciprocal[k]; }
};

struct Extended {
  using Real = long double;
  using Wide = Quad;
  // Quad has 113 bits unless it is long double.
  static constexpr long double kWideUnit =
      std::is_same_v<Quad, long double> ? std::numeric_limits<long double>::epsilon() / 2 : 0x1p-113L;
  static const std::vector<Quad>& conversion(const JacobianTable& table) { return table.wide_value; }
  static long double reciprocal(const JacobianTable& table, std::size_t k) { return table.long_jacobian_reciprocal[k]; }
};

/// Scaled coefficients of the first d components of χ − x₀, [coefficient][component].
template <class Arithmetic>
std::vector<typename Arithmetic::Wide> convert(const CellToCertify& cell, std::size_t d,
                                               std::array<typename Arithmetic::Real, 3>& extent,
                                               const StopToken* stop = nullptr) {
  using Wide = typename Arithmetic::Wide;
  using Real = typename Arithmetic::Real;
  const JacobianTable& table = *cell.table;
  const auto at = [&](std::size_t n, std::size_t c) {
    return cell.coordinates[3 * static_cast<std::size_t>(cell.nodes[n]) + c];
  };
  std::vector<Wide> nodes(static_cast<std::size_t>(table.nodes) * d);
  for (std::size_t n = 0; n < static_cast<std::size_t>(table.nodes); ++n)
    for (std::size_t c = 0; c < d; ++c) {
      nodes[n * d + c] = (Wide(at(n, c)) - Wide(at(0, c))) * Wide(cell.scale);
      extent[c] = std::max(extent[c], std::abs(static_cast<Real>(nodes[n * d + c])));
    }
  const auto& value = Arithmetic::conversion(table);
  std::vector<Wide> map(static_cast<std::size_t>(table.map.size()) * d, Wide(0));
  for (std::size_t row = 0; row + 1 < table.row_start.size(); ++row) {
    look(stop);
    for (std::uint32_t e = table.row_start[row]; e < table.row_start[row + 1]; ++e)
      for (std::size_t c = 0; c < d; ++c) map[row * d + c] += value[e] * nodes[table.column[e] * d + c];
  }
  return map;
}

template <class Real>
Real dot(const Real* a, const Real* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class Real>
std::vector<Real> cross_products(const JacobianTable& table, const std::vector<Real>& a, const std::vector<Real>& b,
                                 const StopToken* stop) {
  std::vector<Real> cross(static_cast<std::size_t>(table.cross.size()) * 3, Real(0));
  for (std::size_t k = 0; k + 1 < table.cross_terms.start.size(); ++k) {
    look(stop);
    for (std::uint32_t e = table.cross_terms.start[k]; e < table.cross_terms.start[k + 1]; ++e) {
      const Real* p = a.data() + table.cross_terms.pairs[e][0] * 3;
      const Real* q = b.data() + table.cross_terms.pairs[e][1] * 3;
      cross[3 * k] += p[1] * q[2] - p[2] * q[1];
      cross[3 * k + 1] += p[2] * q[0] - p[0] * q[2];
      cross[3 * k + 2] += p[0] * q[1] - p[1] * q[0];
    }
  }
  return cross;
}

template <class Arithmetic>
Coefficients<typename Arithmetic::Real> coefficients(const CellToCertify& cell, const StopToken* stop = nullptr) {
  using Real = typename Arithmetic::Real;
  const JacobianTable& table = *cell.table;
  const auto d = static_cast<std::size_t>(table.dimension);
  constexpr Real unit = std::numeric_limits<Real>::epsilon() / 2;
  std::array<Real, 3> extent{};
  const auto map = convert<Arithmetic>(cell, d, extent, stop);
  std::array<std::vector<Real>, 3> g;
  Real size[3][3] = {}, error[3][3] = {};
  for (std::size_t r = 0; r < d; ++r) {
    g[r].reserve(table.difference[r].size() * d);
    for (std::size_t i = 0; i < table.difference[r].size(); ++i) {
      const Difference& difference = table.difference[r][i];
      for (std::size_t c = 0; c < d; ++c) {
        using Wide = typename Arithmetic::Wide;
        g[r].push_back(static_cast<Real>(Wide(difference.plus_weight) * map[difference.plus * d + c] -
                                         Wide(difference.minus_weight) * map[difference.minus * d + c]));
        size[r][c] = std::max(size[r][c], std::abs(g[r].back()) * Real(table.derivative_reciprocal[r][i]));
      }
    }
    // The second term is the rounding from Wide to Real.
    for (std::size_t c = 0; c < d; ++c)
      error[r][c] = relative_rounding<Real>(table.conversion_roundings, Arithmetic::kWideUnit) *
                        Real(table.condition[r]) * extent[c] +
                    2 * unit * size[r][c];
  }
  Coefficients<Real> result;
  const Real product = relative_rounding<Real>(table.product_roundings, unit);
  const auto number = [](double c) { return Real(c); };
  result.error = d == 2 ? HWY_NAMESPACE::rounding_bound<2>(size, error, product, number)
                        : HWY_NAMESPACE::rounding_bound<3>(size, error, product, number);
  for (const Real x : extent) result.error += x * 0;
  result.values.reserve(static_cast<std::size_t>(table.jacobian.size()));
  const std::vector<Real> cross = d == 3 ? cross_products(table, g[1], g[2], stop) : std::vector<Real>();
  for (std::size_t k = 0; k + 1 < table.jacobian_terms.start.size(); ++k) {
    look(stop);
    Real sum = 0;
    for (std::uint32_t e = table.jacobian_terms.start[k]; e < table.jacobian_terms.start[k + 1]; ++e) {
      const auto [i, j] = table.jacobian_terms.pairs[e];
      if (d == 3)
        sum += dot(g[0].data() + i * 3, cross.data() + j * 3);
      else
        sum += g[0][i * 2u] * g[1][j * 2u + 1] - g[0][i * 2u + 1] * g[1][j * 2u];
    }
    result.values.push_back(sum * Arithmetic::reciprocal(table, k) * Real(cell.sign));
  }
  return result;
}

}  // namespace

Coefficients<double> plain_coefficients(const CellToCertify& cell) { return coefficients<Plain>(cell); }

Coefficients<long double> extended_coefficients(const CellToCertify& cell, const StopToken* stop) {
  return coefficients<Extended>(cell, stop);
}

std::array<double, 3> physical_place(const CellToCertify& cell, const std::array<double, 6>& barycentric) {
  const JacobianTable& table = *cell.table;
  std::array<double, 3> extent{}, place{};
  const std::vector<double> map = convert<Plain>(cell, 3, extent);
  const double* origin = cell.coordinates + 3 * static_cast<std::size_t>(cell.nodes[0]);
  for (std::size_t k = 0; k < static_cast<std::size_t>(table.map.size()); ++k) {
    double monomial = 1;
    for (std::size_t slot = 0; slot < 6; ++slot)
      for (int e = 0; e < table.map.exponents()[k][slot]; ++e) monomial *= barycentric[slot];
    for (std::size_t c = 0; c < 3; ++c) place[c] += monomial * map[3 * k + c];
  }
  for (std::size_t c = 0; c < 3; ++c) place[c] = origin[c] + place[c] / cell.scale;
  return place;
}

}  // namespace varimesh::detail
