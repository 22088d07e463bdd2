// Backtracking: which share of a step is accepted.
#include "core/solvers/line_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace varimesh {
namespace {

TEST(LineSearch, TakesTheFullStepToTheMinimumOfAParabola) {
  const auto energy = [](double alpha) { return (alpha - 1) * (alpha - 1); };
  const AcceptedStep step = backtrack({1, -2, 0, 30}, energy);
  EXPECT_EQ(step.alpha, 1);
  EXPECT_EQ(step.energy, 0);
}

TEST(LineSearch, HalvesTheStepUntilTheEnergyFallsEnough) {
  // The minimum is at 0.1: 1/2 and 1/4 raise the energy, 1/8 lowers it.
  const auto energy = [](double alpha) { return alpha * alpha - 0.2 * alpha; };
  const AcceptedStep step = backtrack({0, -0.2, 0, 30}, energy);
  EXPECT_EQ(step.alpha, 0.125);
  EXPECT_EQ(step.energy, energy(0.125));
}

TEST(LineSearch, AsksForMoreThanNoIncrease) {
  // The energy falls, but by less than 1e-4 of what the slope predicts.
  const auto energy = [](double alpha) { return -1e-5 * alpha; };
  EXPECT_EQ(backtrack({0, -1, 0, 30}, energy).alpha, 0);
}

TEST(LineSearch, AvoidsStepsThatAreNotAllowed) {
  const auto energy = [](double alpha) {
    return alpha > 0.3   ? std::numeric_limits<double>::infinity()
           : alpha > 0.2 ? std::numeric_limits<double>::quiet_NaN()
                         : -alpha;
  };
  EXPECT_EQ(backtrack({0, -1, 0, 30}, energy).alpha, 0.125);
}

TEST(LineSearch, GivesUpAfterTheLastTrial) {
  std::vector<double> tried;
  const auto energy = [&](double alpha) {
    tried.push_back(alpha);
    return 1.0;
  };
  EXPECT_EQ(backtrack({0, -1, 0, 4}, energy).alpha, 0);
  EXPECT_EQ(tried, (std::vector<double>{1, 0.5, 0.25, 0.125}));
}

TEST(LineSearch, AcceptsNoiseOnlyIfThePredictedDecreaseIsNoiseToo) {
  const auto raised = [](double) { return 1 + 1e-15; };
  EXPECT_EQ(backtrack({1, -1e-16, 1e-14, 30}, raised).alpha, 1);
  EXPECT_EQ(backtrack({1, -1e-3, 1e-14, 3}, raised).alpha, 0);
}

}  // namespace
}  // namespace varimesh
