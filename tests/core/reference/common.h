// Shared by the tests of the reference cells: the list of shapes, and polynomials with known derivatives.
#pragma once

#include <cmath>
#include <string>

#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh::reference {

inline constexpr std::array<Shape, 7> kCells{Shape::Line,    Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                                             Shape::Pyramid, Shape::Prism,    Shape::Hexahedron};

/// Names the shape and order in a failure.
inline std::string at(Shape shape, int order) {
  return std::string(info(shape).name) + " of order " + std::to_string(order);
}

/// A plane wave's power, (a + b·x)^n: a polynomial of total degree n that depends on every coordinate in every mixed
/// term, and stays near 1 in size on the reference cells.
struct Power {
  int exponent;
  double constant = 0.3;
  std::array<double, 3> slope{0.37, -0.21, 0.28};

  double inner(const Points& points, Eigen::Index row) const {
    double sum = constant;
    for (Eigen::Index c = 0; c < points.cols(); ++c) sum += slope[c] * points(row, c);
    return sum;
  }
  Eigen::VectorXd values(const Points& points) const {
    Eigen::VectorXd all(points.rows());
    for (Eigen::Index p = 0; p < points.rows(); ++p) all[p] = std::pow(inner(points, p), exponent);
    return all;
  }
  Eigen::VectorXd derivative(const Points& points, int direction) const {
    Eigen::VectorXd all(points.rows());
    for (Eigen::Index p = 0; p < points.rows(); ++p)
      all[p] = exponent == 0 ? 0.0 : exponent * slope[direction] * std::pow(inner(points, p), exponent - 1);
    return all;
  }
};

}  // namespace varimesh::reference
