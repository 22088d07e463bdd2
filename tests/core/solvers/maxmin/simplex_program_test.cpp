// The weights fulfil the conditions of the optimum, and agree with a formula where there is one.
#include "core/solvers/maxmin/simplex_program.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <vector>

namespace varimesh {
namespace {

Eigen::VectorXd weights_for(const Eigen::MatrixXd& K, double s, const Eigen::VectorXd& c) {
  std::vector<Eigen::VectorXd> columns(K.colwise().begin(), K.colwise().end());
  return detail::simplex_weights(
      [&](Eigen::Index i) -> const Eigen::VectorXd& { return columns[static_cast<std::size_t>(i)]; }, s, c);
}

TEST(SimplexProgram, FulfilsTheConditionsOfTheOptimum) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (const Eigen::Index rows : {1, 2, 5, 40, 120}) {
    const Eigen::MatrixXd slope = Eigen::MatrixXd::NullaryExpr(rows, 15, [&] { return normal(random); });
    const Eigen::VectorXd c = Eigen::VectorXd::NullaryExpr(rows, [&] { return normal(random); });
    const Eigen::MatrixXd K = slope * slope.transpose();
    const Eigen::VectorXd weights = weights_for(K, 0.5, c);
    EXPECT_NEAR(weights.sum(), 1, 1e-12);
    EXPECT_GE(weights.minCoeff(), 0);
    // All entries with weight have the least slope.
    const Eigen::VectorXd derivative = 0.5 * K * weights + c;
    for (Eigen::Index i = 0; i < rows; ++i)
      if (weights(i) > 0) {
        EXPECT_NEAR(derivative(i), derivative.minCoeff(), 1e-4 * (1 + std::abs(derivative.minCoeff()))) << rows;
      }
  }
}

TEST(SimplexProgram, SharesTheWeightOfTwoRowsByFormula) {
  // f(w) = (2 w² + (1 − w)²)/2 + .3 w has its minimum where 2 w − (1 − w) + .3 = 0.
  const Eigen::MatrixXd K = Eigen::Vector2d(2, 1).asDiagonal();
  const Eigen::VectorXd weights = weights_for(K, 1, Eigen::Vector2d(0.3, 0));
  EXPECT_NEAR(weights(0), 0.7 / 3, 1e-9);
}

TEST(SimplexProgram, AsksOnlyForTheColumnsOfEntriesThatHadWeight) {
  // The third entry is so high that it never has any.
  const Eigen::VectorXd first = Eigen::Vector3d(2, 0, 0), second = Eigen::Vector3d(0, 1, 0);
  std::set<Eigen::Index> asked;
  const Eigen::VectorXd weights = detail::simplex_weights(
      [&](Eigen::Index i) -> const Eigen::VectorXd& {
        asked.insert(i);
        return i == 0 ? first : second;
      },
      1, Eigen::Vector3d(0.3, 0, 5));
  EXPECT_EQ(asked, (std::set<Eigen::Index>{0, 1}));
  EXPECT_EQ(weights(2), 0);
  EXPECT_NEAR(weights(0), 0.7 / 3, 1e-9);
}

}  // namespace
}  // namespace varimesh
