// Builds the tables from those of the certificates, and multiplies polynomials by them.
#include "core/solvers/untangle/coefficient_table.h"

#include <algorithm>
#include <utility>

#include "core/base/index.h"
#include "core/kernels/dense/dense_product.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"
#include "core/validity/bernstein.h"

namespace varimesh {
namespace {

using detail::BernsteinSpace;

/// For each pair of coefficients of `a` and `b` (those of `b` innermost): the number of their product in `product`.
std::vector<std::uint16_t> product_numbers(const BernsteinSpace& a, const BernsteinSpace& b,
                                           const BernsteinSpace& product) {
  std::vector<std::uint16_t> result;
  result.reserve(at(a.size()) * at(b.size()));
  for (const detail::Exponents& x : a.exponents())
    for (const detail::Exponents& y : b.exponents()) {
      detail::Exponents sum = x;
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = static_cast<std::int8_t>(sum[k] + y[k]);
      result.push_back(static_cast<std::uint16_t>(product.index(sum)));
    }
  return result;
}

BernsteinSpace product_space(const BernsteinSpace& a, const BernsteinSpace& b) {
  std::vector<detail::Factor> factors = a.factors();
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f].degree += b.factors()[f].degree;
  return BernsteinSpace(factors);
}

/// The matrix from the optimised nodes to the scaled coefficients of χ.
Eigen::MatrixXd map_of_nodes(const detail::JacobianTable& table) {
  Eigen::MatrixXd of_equispaced = Eigen::MatrixXd::Zero(table.map.size(), table.nodes);
  for (int row = 0; row < table.map.size(); ++row)
    for (std::uint32_t e = table.row_start[at(row)]; e < table.row_start[at(row) + 1]; ++e)
      of_equispaced(row, table.column[e]) = table.value[e];
  return of_equispaced * reference::conversion(table.shape, table.order, reference::NodeSet::Optimised,
                                               reference::NodeSet::Equispaced, table.dimension);
}

CoefficientTable make_table(const detail::JacobianTable& from) {
  CoefficientTable table;
  const int d = table.dimension = from.dimension;
  table.size = from.jacobian.size();
  table.reciprocal = Eigen::Map<const Eigen::VectorXd>(from.jacobian_reciprocal.data(), table.size);
  const Eigen::MatrixXd map = map_of_nodes(from);
  for (int r = 0; r < d; ++r) {
    const auto& differences = from.difference[at(r)];
    Eigen::MatrixXd& rows = table.derivative[at(r)];
    rows.resize(static_cast<Eigen::Index>(differences.size()), map.cols());
    for (std::size_t i = 0; i < differences.size(); ++i)
      rows.row(static_cast<Eigen::Index>(i)) = differences[i].plus_weight * map.row(differences[i].plus) -
                                               differences[i].minus_weight * map.row(differences[i].minus);
    const BernsteinSpace& next = from.derivative[at((r + 1) % d)];
    const BernsteinSpace cofactor = d == 2 ? next : product_space(next, from.derivative[at((r + 2) % d)]);
    if (d == 3) table.cross[at(r)] = product_numbers(next, from.derivative[at((r + 2) % d)], cofactor);
    table.cofactor_size[at(r)] = cofactor.size();
    table.product[at(r)] = product_numbers(from.derivative[at(r)], cofactor, from.jacobian);
  }
  return table;
}

}  // namespace

CoefficientTable::Vectors CoefficientTable::derivatives(const Eigen::MatrixXd& positions) const {
  // Relative to the first node, so that no digits are lost if the cell is far from the origin.
  const Eigen::MatrixXd relative = positions.rowwise() - positions.row(0);
  Vectors result;
  for (int r = 0; r < dimension; ++r) result[at(r)].noalias() = derivative[at(r)] * relative;
  return result;
}

CoefficientTable::Vectors CoefficientTable::cofactors(const Vectors& derivatives) const {
  Vectors result;
  if (dimension == 2) {
    // J = g_0x g_1y − g_0y g_1x
    result[0].resize(cofactor_size[0], 2);
    result[0] << derivatives[1].col(1), -derivatives[1].col(0);
    result[1].resize(cofactor_size[1], 2);
    result[1] << -derivatives[0].col(1), derivatives[0].col(0);
    return result;
  }
  for (std::size_t r = 0; r < 3; ++r) {
    const Eigen::MatrixXd &a = derivatives[(r + 1) % 3], &b = derivatives[(r + 2) % 3];
    result[r] = Eigen::MatrixXd::Zero(cofactor_size[r], 3);
    const std::uint16_t* number = cross[r].data();
    for (Eigen::Index i = 0; i < a.rows(); ++i)
      for (Eigen::Index j = 0; j < b.rows(); ++j, ++number)
        for (int c = 0; c < 3; ++c) {
          const int y = (c + 1) % 3, z = (c + 2) % 3;
          result[r](*number, c) += a(i, y) * b(j, z) - a(i, z) * b(j, y);
        }
  }
  return result;
}

Eigen::VectorXd CoefficientTable::jacobian(const Vectors& derivatives, const Vectors& cofactors) const {
  const Eigen::MatrixXd &a = derivatives[0], &b = cofactors[0];
  Eigen::VectorXd result = Eigen::VectorXd::Zero(size);
  const std::uint16_t* number = product[0].data();
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index j = 0; j < b.rows(); ++j, ++number)
      for (int c = 0; c < dimension; ++c) result[*number] += a(i, c) * b(j, c);
  return result.cwiseProduct(reciprocal);
}

Eigen::MatrixXd CoefficientTable::slope(const Vectors& cofactors, const std::vector<int>& nodes,
                                        const StopToken* stop) const {
  const Eigen::Index columns = static_cast<Eigen::Index>(nodes.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, columns * dimension);
  Eigen::MatrixXd of_derivative, chosen;
  for (std::size_t r = 0; r < at(dimension); ++r) {
    chosen = derivative[r](Eigen::all, nodes).transpose();
    const Eigen::MatrixXd& b = cofactors[r];
    for (int c = 0; c < dimension; ++c) {
      look(stop);
      // dJ = Σ_i dg_r,i,c (the polynomial λ^i C_r,c): one column per i.
      of_derivative.setZero(size, chosen.cols());
      const std::uint16_t* number = product[r].data();
      for (Eigen::Index i = 0; i < chosen.cols(); ++i)
        for (Eigen::Index j = 0; j < b.rows(); ++j, ++number) of_derivative(*number, i) += b(j, c);
      // Column n of the product belongs to column n d + c of the result.
      detail::add_product(of_derivative, chosen, result.data() + c * size, dimension * size, detail::Entries::All,
                          stop);
    }
  }
  return reciprocal.asDiagonal() * result;
}

const CoefficientTable& coefficient_table(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, CoefficientTable> cache;
  return cache.get(std::pair(shape, order), [&] { return make_table(detail::jacobian_table(shape, order)); });
}

}  // namespace varimesh
