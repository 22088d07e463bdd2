// Quadrature rules: positive, inside, and exact to the degree they claim.
#include "core/reference/quadrature.h"

#include <gtest/gtest.h>

#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

/// ∫ x^n over [−1, 1].
double line_moment(int n) { return n % 2 == 1 ? 0 : 2.0 / (n + 1); }

/// ∫ ρ^i σ^j τ^k over the reference simplex of that dimension, ρ = (1 + r)/2 and so on: Dirichlet's integral.
double simplex_moment(int dimension, int i, int j, int k) {
  const double measure = std::exp2(dimension);
  return measure * std::tgamma(i + 1.0) * std::tgamma(j + 1.0) * std::tgamma(k + 1.0) /
         std::tgamma(i + j + k + dimension + 1.0);
}

/// Integral of the monomial of exponents (i, j, k): on simplices in (1 + x)/2, on pyramids in x, y and
/// t = (1 − z)/2, and else in the coordinates themselves. No monomial exceeds 1, so errors are comparable.
double exact(Shape shape, int i, int j, int k) {
  switch (shape) {
    case Shape::Triangle:
      return simplex_moment(2, i, j, 0);
    case Shape::Tetrahedron:
      return simplex_moment(3, i, j, k);
    case Shape::Prism:
      return simplex_moment(2, i, j, 0) * line_moment(k);
    case Shape::Pyramid:
      // |x|, |y| ≤ t, and t goes from 0 to 1.
      return line_moment(i) * line_moment(j) * 2 / (i + j + k + 3);
    default:
      return line_moment(i) * (info(shape).dimension > 1 ? line_moment(j) : 1.0) *
             (info(shape).dimension > 2 ? line_moment(k) : 1.0);
  }
}

double by_rule(Shape shape, const Quadrature& rule, int i, int j, int k) {
  const bool simplex = shape == Shape::Triangle || shape == Shape::Tetrahedron;
  double sum = 0;
  for (Eigen::Index p = 0; p < rule.weights.size(); ++p) {
    double value = rule.weights[p];
    const std::array<int, 3> exponent{i, j, k};
    for (Eigen::Index c = 0; c < rule.points.cols(); ++c) {
      double x = rule.points(p, c);
      if (simplex || (shape == Shape::Prism && c < 2)) x = (1 + x) / 2;
      if (shape == Shape::Pyramid && c == 2) x = (1 - x) / 2;
      value *= std::pow(x, exponent[c]);
    }
    sum += value;
  }
  return sum;
}

bool strictly_inside(Shape shape, const Eigen::RowVectorXd& x) {
  if ((x.array().abs() >= 1).any()) return false;
  switch (shape) {
    case Shape::Triangle:
    case Shape::Prism:
      return x[0] + x[1] < 0;
    case Shape::Tetrahedron:
      return x.sum() < -1;
    case Shape::Pyramid:
      return std::max(std::abs(x[0]), std::abs(x[1])) < (1 - x[2]) / 2;
    default:
      return true;
  }
}

TEST(Quadrature, HasPositiveWeightsAtPointsStrictlyInside) {
  for (const Shape shape : kCells) {
    for (int order = 1; order <= kMaxOrder; ++order) {
      const Quadrature rule = quadrature(shape, order, 2 * order);
      EXPECT_GT(rule.weights.minCoeff(), 0) << at(shape, order);
      EXPECT_NEAR(rule.weights.sum(), info(shape).measure, 2e-14) << at(shape, order);
      for (Eigen::Index p = 0; p < rule.points.rows(); ++p)
        EXPECT_TRUE(strictly_inside(shape, rule.points.row(p))) << at(shape, order) << ", point " << p;
    }
  }
}

TEST(Quadrature, IsExactToTheDegreeItClaims) {
  for (const Shape shape : kCells) {
    const int dimension = info(shape).dimension;
    for (int order = 1; order <= kMaxOrder; ++order) {
      const Quadrature rule = quadrature(shape, order, 2 * order);
      ASSERT_GE(rule.degree, 2 * order) << at(shape, order);
      double worst = 0;
      for (int i = 0; i <= rule.degree; ++i) {
        for (int j = 0; i + j <= (dimension > 1 ? rule.degree : i); ++j) {
          // In three dimensions the lowest, a middle and the highest power of the third coordinate are enough.
          const int most = dimension > 2 ? rule.degree - i - j : 0;
          for (const int k : {0, most / 2, most}) {
            const double expected = exact(shape, i, j, k);
            worst = std::max(worst, std::abs(by_rule(shape, rule, i, j, k) - expected));
          }
        }
      }
      EXPECT_LT(worst, 5e-14) << at(shape, order);
    }
  }
}

TEST(Quadrature, IsExactForEveryStoredAndConicalDegree) {
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron}) {
    for (int degree = 1; degree <= 24; ++degree) {
      const Quadrature rule = quadrature(shape, 1, degree);
      EXPECT_GE(rule.degree, degree);
      for (int i = 0; i <= degree; ++i) {
        const int k = shape == Shape::Tetrahedron ? (degree - i) / 2 : 0;
        const int j = degree - i - k;
        const double expected = exact(shape, i, j, k);
        EXPECT_NEAR(by_rule(shape, rule, i, j, k), expected, 1e-15 + 1e-12 * expected) << degree;
      }
    }
  }
}

TEST(Quadrature, TakesTheSmallestStoredRuleAndConesAboveTheTables) {
  EXPECT_EQ(quadrature(Shape::Tetrahedron, 4, 8).weights.size(), 46);
  EXPECT_EQ(quadrature(Shape::Tetrahedron, 4, 4).weights.size(), 14)
      << "degree 4 is not stored, so the rule of degree 5 is taken";
  EXPECT_EQ(quadrature(Shape::Triangle, 10, 20).weights.size(), 79);
  EXPECT_EQ(quadrature(Shape::Triangle, 10, 21).weights.size(), 121);
  EXPECT_EQ(quadrature(Shape::Hexahedron, 3, 2).weights.size(), 64)
      << "never fewer than order + 1 points per direction";
  EXPECT_EQ(quadrature(Shape::Hexahedron, 3, 9).weights.size(), 125);
}

}  // namespace
}  // namespace varimesh::reference
