#include "core/solvers/descent/order_tables.h"

#include <utility>

#include "core/quality/accuracy/parts_table.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"
#include "core/reference/quadrature.h"

namespace varimesh::detail {
namespace {

constexpr auto kSet = reference::NodeSet::Optimised;

OrderTables::Squares make_squares(Shape shape, int order, const Eigen::MatrixXd& modes, const PartsTable& parts) {
  const int d = reference::info(shape).dimension;
  OrderTables::Squares squares;
  for (int part = 0; part + 2 <= order; ++part) {
    const auto rows = modes.middleRows(parts.first[part], parts.first[part + 1] - parts.first[part]);
    std::vector<Eigen::VectorXd>& of_part = squares.of_parts.emplace_back();
    for (const Eigen::MatrixXd& product : parts.products[part])
      of_part.emplace_back(rows.cwiseProduct(product * rows).colwise().sum().transpose());
  }
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order);
  const std::vector<Eigen::MatrixXd> gradients = reference::basis_gradients(shape, order, kSet, d, rule.points);
  const Eigen::VectorXd weights = rule.weights / reference::info(shape).measure;
  for (int a = 0; a < d; ++a)
    for (int b = a; b < d; ++b)
      squares.of_gradient.emplace_back(gradients[a].cwiseProduct(gradients[b]).transpose() * weights);
  return squares;
}

OrderTables make_tables(Shape shape, int order) {
  const int d = reference::info(shape).dimension;
  const PartsTable& parts = parts_table(shape, order, kSet);
  OrderTables tables;
  for (int q = 1; q < order; ++q)
    tables.raise.push_back(reference::basis_values(shape, q, kSet, d, reference::nodes(shape, q + 1, kSet, d)));
  tables.squares.resize(static_cast<std::size_t>(order));
  Eigen::MatrixXd modes = parts.to_modes;
  for (int q = order; q >= 1; --q) {
    tables.squares[q - 1] = make_squares(shape, q, modes, parts);
    if (q > 1) modes = modes * tables.raise[q - 2];
  }
  return tables;
}

}  // namespace

const OrderTables& order_tables(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, OrderTables> tables;
  return tables.get({shape, order}, [&] { return make_tables(shape, order); });
}

}  // namespace varimesh::detail
