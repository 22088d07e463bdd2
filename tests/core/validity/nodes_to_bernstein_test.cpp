// From Lagrange nodes to Bernstein coefficients: known entries, and polynomials that come out as they went in.
#include "core/validity/nodes_to_bernstein.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/reference/basis.h"
#include "core/reference/nodes.h"
#include "tests/core/support/bernstein_cells.h"

namespace varimesh::detail {
namespace {

TEST(NodesToBernstein, HasTheKnownEntriesOfAQuadraticEdge) {
  // On a triangle of order 2 the scaled coefficient of λ₀λ₁ is 4 x₀₁ − x₀ − x₁, with the edge's middle node 3.
  const BernsteinSpace& space = jacobian_table(Shape::Triangle, 2).map;
  const auto rows = nodes_to_bernstein(Shape::Triangle, 2, space);
  const auto& middle = rows[static_cast<std::size_t>(space.index({1, 1, 0, 0, 0, 0}))];
  const double expected[] = {-1, -1, 0, 4, 0, 0};
  for (std::size_t node = 0; node < 6; ++node) EXPECT_EQ(static_cast<double>(middle[node]), expected[node]);
  const auto& vertex = rows[static_cast<std::size_t>(space.index({0, 2, 0, 0, 0, 0}))];
  for (std::size_t node = 0; node < 6; ++node) EXPECT_EQ(static_cast<double>(vertex[node]), node == 1 ? 1 : 0);
}

class NodesToBernsteinOf : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, NodesToBernsteinOf, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(NodesToBernsteinOf, GivesConstantsTheirMultinomials) {
  for (int order = 1; order <= 6; ++order) {
    const BernsteinSpace& space = jacobian_table(GetParam(), order).map;
    const auto rows = nodes_to_bernstein(GetParam(), order, space);
    ASSERT_EQ(static_cast<int>(rows.size()), space.size());
    for (int k = 0; k < space.size(); ++k) {
      Quad sum = 0;
      for (const Quad entry : rows[static_cast<std::size_t>(k)]) sum += entry;
      EXPECT_NEAR(static_cast<double>(sum), static_cast<double>(space.multinomial(k)),
                  1e-15 * static_cast<double>(space.multinomial(k)));
    }
  }
}

TEST_P(NodesToBernsteinOf, ReproducesAPolynomial) {
  const int order = 4;
  const BernsteinSpace& space = jacobian_table(GetParam(), order).map;
  const auto rows = nodes_to_bernstein(GetParam(), order, space);
  const int d = reference::info(GetParam()).dimension;
  const reference::Points& nodes = reference::nodes(GetParam(), order, reference::NodeSet::Equispaced, d);
  const auto polynomial = [&](const Eigen::RowVectorXd& x) {
    return std::pow(0.2 + 0.4 * x(0) - 0.3 * x(1) + (d == 3 ? 0.25 * x(2) : 0.0), order);
  };
  // evaluate() takes coefficients that are not scaled.
  std::vector<long double> coefficients;
  for (int k = 0; k < space.size(); ++k) {
    Quad sum = 0;
    for (Eigen::Index n = 0; n < nodes.rows(); ++n)
      sum += rows[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)] * Quad(polynomial(nodes.row(n)));
    coefficients.push_back(static_cast<long double>(sum) / space.multinomial(k));
  }
  reference::Points points = reference::uniform_lattice(GetParam(), 3);
  const Eigen::RowVectorXd middle = points.colwise().mean();
  points = (0.9 * points).rowwise() + 0.1 * middle;
  for (Eigen::Index p = 0; p < points.rows(); ++p)
    EXPECT_NEAR(evaluate(space, coefficients, barycentric(GetParam(), points.row(p))), polynomial(points.row(p)),
                1e-13);
}

}  // namespace
}  // namespace varimesh::detail
