#include "core/reference/serendipity.h"

#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::reference {

namespace {

using Position = std::array<std::int8_t, 3>;

/// The value at `at` of the function of the node at `own`, which lies on a vertex or edge: the sum over edges of their
/// curves, each times the linear functions of the other directions, less what the vertices count too often.
double blended(const Position& own, const Position& at, int order, int dimension) {
  const auto linear = [&](std::size_t k) {
    const double t = double(at[k]) / order;
    return own[k] == 0 ? 1 - t : t;
  };
  const auto directions = std::size_t(dimension);
  double sum = 0, product = 1;
  int inner = -1;  // the direction in which the node lies inside an edge
  for (std::size_t k = 0; k < directions; ++k)
    if (own[k] != 0 && own[k] != order) inner = int(k);
  for (std::size_t along = 0; along < directions; ++along) {
    if (inner >= 0 && int(along) != inner) continue;
    if (own[along] != at[along]) continue;
    double weight = 1;
    for (std::size_t k = 0; k < directions; ++k)
      if (k != along) weight *= linear(k);
    sum += weight;
  }
  if (inner >= 0) return sum;
  for (std::size_t k = 0; k < directions; ++k) product *= linear(k);
  return sum - (dimension - 1) * product;
}

Eigen::MatrixXd blended_values(Shape shape, int order) {
  const auto& at = lattice(shape, order);
  const int own = serendipity_node_count(shape, order), missing = node_count(shape, order) - own;
  Eigen::MatrixXd values(missing, own);
  for (int i = 0; i < missing; ++i)
    for (int k = 0; k < own; ++k)
      values(i, k) = blended(at[std::size_t(k)], at[std::size_t(own + i)], order, info(shape).dimension);
  return values;
}

/// Order 2: the only missing nodes are in the middle of quadrilateral faces.
Eigen::MatrixXd values_on_faces(Shape shape) {
  constexpr int kOrder = 2;
  const int own = serendipity_node_count(shape, kOrder);
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(node_count(shape, kOrder) - own, own);
  const Eigen::MatrixXd& face_values = serendipity_values(Shape::Quadrilateral, kOrder);
  for (std::size_t face = 0; face < info(shape).faces.size(); ++face) {
    if (info(shape).faces[face].shape != Shape::Quadrilateral) continue;
    const std::vector<int>& nodes = facet_nodes(shape, kOrder, int(face));
    for (Eigen::Index k = 0; k < face_values.cols(); ++k)
      values(nodes.back() - own, nodes[std::size_t(k)]) = face_values(0, k);
  }
  return values;
}

/// Solves V^T X = R in place by Gaussian elimination with row pivots. V has at most 30 rows.
Eigen::MatrixXd solve_transposed(const Eigen::MatrixXd& v, Eigen::MatrixXd right) {
  Eigen::MatrixXd a = v.transpose();
  const Eigen::Index n = a.rows();
  for (Eigen::Index column = 0; column < n; ++column) {
    Eigen::Index pivot = column;
    for (Eigen::Index row = column; row < n; ++row)
      if (std::abs(a(row, column)) > std::abs(a(pivot, column))) pivot = row;
    a.row(column).swap(a.row(pivot));
    right.row(column).swap(right.row(pivot));
    for (Eigen::Index row = 0; row < n; ++row) {
      if (row == column) continue;
      const double factor = a(row, column) / a(column, column);
      a.row(row) -= factor * a.row(column);
      right.row(row) -= factor * right.row(column);
    }
  }
  for (Eigen::Index row = 0; row < n; ++row) right.row(row) /= a(row, row);
  return right;
}

/// Gmsh's monomials have the positions of the nodes on the edges as exponents (gmshGenerateMonomialsTriangle).
Eigen::MatrixXd triangle_values(int order) {
  const auto& at = lattice(Shape::Triangle, order);
  const int own = serendipity_node_count(Shape::Triangle, order), all = node_count(Shape::Triangle, order);
  const auto monomials = [&](int first, int last) {
    Eigen::MatrixXd values(last - first, own);
    for (int node = first; node < last; ++node)
      for (int k = 0; k < own; ++k)
        values(node - first, k) = std::pow(double(at[std::size_t(node)][0]) / order, at[std::size_t(k)][0]) *
                                  std::pow(double(at[std::size_t(node)][1]) / order, at[std::size_t(k)][1]);
    return values;
  };
  return solve_transposed(monomials(0, own), monomials(own, all).transpose()).transpose();
}

}  // namespace

int serendipity_node_count(Shape shape, int order) {
  const bool has_any = (shape == Shape::Quadrilateral || shape == Shape::Hexahedron) ? order >= 2
                       : (shape == Shape::Prism || shape == Shape::Pyramid)          ? order == 2
                                                                            : shape == Shape::Triangle && order >= 3;
  if (!has_any) return 0;
  return info(shape).vertices + int(info(shape).edges.size()) * (order - 1);
}

const Eigen::MatrixXd& serendipity_values(Shape shape, int order) {
  assert(serendipity_node_count(shape, order) > 0);
  static Cache<std::array<int, 2>, Eigen::MatrixXd> cache;
  return cache.get({int(shape), order}, [&]() -> Eigen::MatrixXd {
    if (shape == Shape::Triangle) return triangle_values(order);
    if (shape == Shape::Prism || shape == Shape::Pyramid) return values_on_faces(shape);
    return blended_values(shape, order);
  });
}

}  // namespace varimesh::reference
