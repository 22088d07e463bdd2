// The quadrature rule of each shape: stored symmetric rules on simplices, products and conical products elsewhere.
#include "core/reference/quadrature.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/reference/quadrature_tables.h"

namespace varimesh::reference {
namespace {

/// The points per direction that this degree needs: n points integrate polynomials up to degree 2n − 1.
int gauss_points(int degree) { return degree / 2 + 1; }

Quadrature from_table(int dimension, const StoredRule& rule) {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto count = static_cast<Eigen::Index>(rule.rows.size()) / (dimension + 1);
  const Eigen::Map<const Rows> rows(rule.rows.data(), count, dimension + 1);
  return {rows.leftCols(dimension), rows.col(dimension), rule.degree};
}

Quadrature line_rule(int n) {
  const auto [points, weights] = gauss_jacobi(n, 0, 0);
  return {points, weights, 2 * n - 1};
}

/// Combines every point of `a` with every point of `b`. The coordinates of `b` follow those of `a`.
Quadrature product(const Quadrature& a, const Quadrature& b) {
  Quadrature all;
  all.points.resize(a.points.rows() * b.points.rows(), a.points.cols() + b.points.cols());
  all.weights.resize(all.points.rows());
  for (Eigen::Index i = 0, row = 0; i < a.points.rows(); ++i) {
    for (Eigen::Index j = 0; j < b.points.rows(); ++j, ++row) {
      all.points.row(row) << a.points.row(i), b.points.row(j);
      all.weights[row] = a.weights[i] * b.weights[j];
    }
  }
  all.degree = std::min(a.degree, b.degree);
  return all;
}

/// The conical product of Gauss–Jacobi rules (A. H. Stroud, Approximate Calculation of Multiple Integrals, 1971): a
/// rule on the base that shrinks towards `apex` along the last direction h. At h its measure is t^dimension times that
/// of the base, t = (1 − h)/2. This factor is the Jacobi weight.
Quadrature conical(const Quadrature& base, const Eigen::RowVectorXd& apex, int n) {
  const auto dimension = static_cast<int>(base.points.cols());
  const auto [heights, weights] = gauss_jacobi(n, dimension, 0);
  Quadrature cone;
  cone.points.resize(base.points.rows() * n, dimension + 1);
  cone.weights.resize(cone.points.rows());
  for (Eigen::Index i = 0, row = 0; i < base.points.rows(); ++i) {
    for (int j = 0; j < n; ++j, ++row) {
      const double t = (1 - heights[j]) / 2;
      cone.points.row(row) << apex + t * (base.points.row(i) - apex), heights[j];
      cone.weights[row] = base.weights[i] * weights[j] / std::exp2(dimension);
    }
  }
  cone.degree = std::min(base.degree, 2 * n - 1);
  return cone;
}

Quadrature conical_simplex(int dimension, int n) {
  Quadrature rule = line_rule(n);
  for (int d = 1; d < dimension; ++d) rule = conical(rule, Eigen::RowVectorXd::Constant(d, -1.0), n);
  return rule;
}

Quadrature simplex_rule(int dimension, int degree) {
  for (const StoredRule& rule : dimension == 2 ? triangle_rules() : tetrahedron_rules())
    if (rule.degree >= degree) return from_table(dimension, rule);
  return conical_simplex(dimension, gauss_points(degree));
}

}  // namespace

Quadrature quadrature(Shape shape, int order, int degree) {
  const int n = std::max(order + 1, gauss_points(degree));
  switch (shape) {
    case Shape::Point:
      return {Points(1, 0), Eigen::VectorXd::Ones(1), degree};
    case Shape::Line:
      return line_rule(gauss_points(degree));
    case Shape::Triangle:
      return simplex_rule(2, degree);
    case Shape::Quadrilateral:
      return product(line_rule(n), line_rule(n));
    case Shape::Tetrahedron:
      return simplex_rule(3, degree);
    case Shape::Pyramid:
      return conical(product(line_rule(n), line_rule(n)), Eigen::RowVectorXd::Zero(2), n);
    case Shape::Prism:
      return product(simplex_rule(2, degree), line_rule(n));
    case Shape::Hexahedron:
      return product(product(line_rule(n), line_rule(n)), line_rule(n));
  }
  assert(false && "a shape that is not in the table");
  return {};
}

}  // namespace varimesh::reference
