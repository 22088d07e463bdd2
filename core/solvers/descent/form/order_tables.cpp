#include "core/solvers/descent/form/order_tables.h"

#include <Eigen/LU>
#include <array>
#include <utility>

#include "core/base/index.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"
#include "core/reference/modal.h"
#include "core/reference/quadrature.h"

namespace varimesh::detail {
namespace {

constexpr auto kSet = reference::NodeSet::Optimised;
constexpr int kAmbient = 3;  // lines have the same nodes in every mesh

bool is_product(Shape shape) { return shape == Shape::Quadrilateral || shape == Shape::Hexahedron; }

/// By node of a quadrilateral or hexahedron: its place among those along the axes, the first axis fastest.
std::vector<std::size_t> places_of_nodes(Shape shape, int order) {
  const std::size_t n = at(order) + 1;
  std::vector<std::size_t> places;
  for (const std::array<std::int8_t, 3>& node : reference::lattice(shape, order))
    places.push_back(at(node[0]) + n * (at(node[1]) + n * at(node[2])));
  return places;
}

/// The same by mode of PartsTable. The number of a mode counts the last axis fastest (modal.h).
std::vector<std::size_t> places_of_modes(const std::vector<int>& modes, int order, int axes) {
  const std::size_t n = at(order) + 1;
  std::vector<std::size_t> places;
  for (const int mode : modes) {
    std::size_t place = 0, rest = at(mode);
    for (int a = 0; a < axes; ++a, rest /= n) place = place * n + rest % n;
    places.push_back(place);
  }
  return places;
}

/// A matrix on the nodes of lines with its columns in the order of the places.
Eigen::MatrixXd with_columns_by_place(const Eigen::MatrixXd& matrix, int order) {
  Eigen::MatrixXd sorted(matrix.rows(), matrix.cols());
  const auto& lattice = reference::lattice(Shape::Line, order);
  for (Eigen::Index n = 0; n < matrix.cols(); ++n) sorted.col(lattice[at(n)][0]) = matrix.col(n);
  return sorted;
}

LanePair pair_of(const Eigen::MatrixXd& matrix) { return {lane_matrix(matrix), lane_matrix(matrix.transpose())}; }

LanePair pair_of(const Eigen::MatrixXd& factor, int axes, const std::vector<std::size_t>& rows,
                 const std::vector<std::size_t>& columns) {
  return {lane_matrix(factor, at(axes), rows, columns), lane_matrix(factor.transpose(), at(axes), columns, rows)};
}

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
  std::vector<Eigen::MatrixXd> raise;
  for (int q = 1; q < order; ++q) {
    raise.push_back(reference::basis_values(shape, q, kSet, d, reference::nodes(shape, q + 1, kSet, d)));
    tables.raise.push_back(raising(shape, q));
  }
  tables.squares.resize(static_cast<std::size_t>(order));
  Eigen::MatrixXd modes = parts.to_modes;
  for (int q = order; q >= 1; --q) {
    tables.squares[q - 1] = make_squares(shape, q, modes, parts);
    if (q > 1) modes = modes * raise[at(q - 2)];
  }
  return tables;
}

}  // namespace

LanePair raising(Shape shape, int order) {
  const auto values = [&](Shape of, int ambient) -> Eigen::MatrixXd {
    return reference::basis_values(of, order, kSet, ambient, reference::nodes(of, order + 1, kSet, ambient));
  };
  const int d = reference::info(shape).dimension;
  if (!is_product(shape)) return pair_of(values(shape, d));
  const Eigen::MatrixXd on_line = with_columns_by_place(values(Shape::Line, kAmbient), order);
  const Eigen::MatrixXd factor = with_columns_by_place(on_line.transpose(), order + 1).transpose();
  return pair_of(factor, d, places_of_nodes(shape, order + 1), places_of_nodes(shape, order));
}

LanePair to_modes(Shape shape, int order) {
  const PartsTable& table = parts_table(shape, order, kSet);
  if (!is_product(shape)) return pair_of(table.to_modes);
  const reference::Points& nodes = reference::nodes(Shape::Line, order, kSet, kAmbient);
  const Eigen::MatrixXd modes = reference::modal_values(Shape::Line, order, nodes).inverse();
  const int d = reference::info(shape).dimension;
  return pair_of(with_columns_by_place(modes, order), d, places_of_modes(table.modes, order, d),
                 places_of_nodes(shape, order));
}

const OrderTables& order_tables(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, OrderTables> tables;
  return tables.get({shape, order}, [&] { return make_tables(shape, order); });
}

}  // namespace varimesh::detail
