// The weights fulfil the conditions of the optimum, and agree with a formula where there is one.
#include "core/maxmin/simplex_program.h"

#include <gtest/gtest.h>

#include <random>

namespace varimesh {
namespace {

TEST(SimplexProgram, FulfilsTheConditionsOfTheOptimum) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (const Eigen::Index rows : {1, 2, 5, 40, 120}) {
    const Eigen::MatrixXd slope = Eigen::MatrixXd::NullaryExpr(rows, 15, [&] { return normal(random); });
    const Eigen::VectorXd c = Eigen::VectorXd::NullaryExpr(rows, [&] { return normal(random); });
    const Eigen::MatrixXd K = slope * slope.transpose();
    const Eigen::VectorXd weights = detail::simplex_weights(K, c);
    EXPECT_NEAR(weights.sum(), 1, 1e-12);
    EXPECT_GE(weights.minCoeff(), 0);
    // All entries with weight have the least slope.
    const Eigen::VectorXd derivative = K * weights + c;
    for (Eigen::Index i = 0; i < rows; ++i)
      if (weights(i) > 0) {
        EXPECT_NEAR(derivative(i), derivative.minCoeff(), 1e-4 * (1 + std::abs(derivative.minCoeff()))) << rows;
      }
  }
}

TEST(SimplexProgram, SharesTheWeightOfTwoRowsByFormula) {
  // f(w) = (2 w² + (1 − w)²)/2 + .3 w has its minimum where 2 w − (1 − w) + .3 = 0.
  const Eigen::MatrixXd K = Eigen::Vector2d(2, 1).asDiagonal();
  const Eigen::VectorXd weights = detail::simplex_weights(K, Eigen::Vector2d(0.3, 0));
  EXPECT_NEAR(weights(0), 0.7 / 3, 1e-9);
}

}  // namespace
}  // namespace varimesh
