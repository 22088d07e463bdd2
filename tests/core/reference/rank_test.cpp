// The optimiser's quadrature gives every mode energy: only constants are in the null space of the gradient operator.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

/// Rank of the gradient operator of all the nodes at the rule's points: the number of pivots of its weighted square.
int gradient_rank(Shape shape, int order, const Quadrature& rule) {
  const auto gradients = basis_gradients(shape, order, NodeSet::Optimised, 3, rule.points);
  const Eigen::Index count = node_count(shape, order);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(count, count);
  for (const Eigen::MatrixXd& gradient : gradients) {
    const Eigen::MatrixXd weighted = rule.weights.cwiseSqrt().asDiagonal() * gradient;
    square.selfadjointView<Eigen::Lower>().rankUpdate(weighted.transpose());
  }
  // With a diagonal of ones, a pivot says which part of a node's column is independent of the others.
  const Eigen::VectorXd scale = square.diagonal().cwiseSqrt().cwiseInverse();
  square = (scale.asDiagonal() * square * scale.asDiagonal()).eval();
  const Eigen::LDLT<Eigen::MatrixXd, Eigen::Lower> factor(square);
  return static_cast<int>((factor.vectorD().array() > 1e-10).count());
}

class GradientRank : public testing::TestWithParam<Shape> {};

TEST_P(GradientRank, IsOneLessThanTheNumberOfNodes) {
  const Shape shape = GetParam();
  for (int order = 1; order <= 8; ++order)
    EXPECT_EQ(gradient_rank(shape, order, quadrature(shape, order, 2 * order)), node_count(shape, order) - 1)
        << at(shape, order);
}

INSTANTIATE_TEST_SUITE_P(Shapes, GradientRank, testing::ValuesIn(kCells),
                         [](const auto& test) { return std::string(reference::info(test.param).name); });

TEST(GradientRankOfTooFewPoints, IsLower) {
  // As many points per direction as the order, one fewer than the optimiser takes.
  for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron})
    for (const int order : {2, 4})
      EXPECT_LT(gradient_rank(shape, order, quadrature(shape, order - 1, 2)), node_count(shape, order) - 1)
          << at(shape, order);
}

}  // namespace
}  // namespace varimesh::reference
