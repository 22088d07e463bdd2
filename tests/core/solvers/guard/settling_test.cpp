// A later stage settles when full steps no longer raise the minimum, and not before.
#include "core/solvers/guard/settling.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(Settling, WaitsWhileTheMinimumRises) {
  Settling settling;
  for (int i = 1; i < 20; ++i) EXPECT_FALSE(settling.after(0.04 * i, 1, true)) << i;
}

TEST(Settling, SettlesAfterTwoFullStepsWithoutARise) {
  Settling settling;
  EXPECT_FALSE(settling.after(0.5, 1, true));
  EXPECT_FALSE(settling.after(0.4, 1, true));
  EXPECT_TRUE(settling.after(0.3, 1, true));
}

TEST(Settling, CountsAFallAgainstTheHighestMinimumOfTheStage) {
  Settling settling;
  EXPECT_FALSE(settling.after(0.5, 1, true));
  EXPECT_FALSE(settling.after(0.3, 1, true));
  EXPECT_TRUE(settling.after(0.4, 1, true)) << "higher than before, but lower than the highest";
}

TEST(Settling, BeginsAgainAfterARise) {
  Settling settling;
  EXPECT_FALSE(settling.after(0.5, 1, true));
  EXPECT_FALSE(settling.after(0.4, 1, true));
  EXPECT_FALSE(settling.after(0.6, 1, true));
  EXPECT_FALSE(settling.after(0.6, 1, true));
  EXPECT_TRUE(settling.after(0.6, 1, true));
}

TEST(Settling, DoesNotCountATinyRise) {
  Settling settling;
  EXPECT_FALSE(settling.after(0.5, 1, true));
  EXPECT_FALSE(settling.after(0.5001, 1, true));
  EXPECT_TRUE(settling.after(0.5002, 1, true));
}

TEST(Settling, DoesNotCountPartsOfSteps) {
  Settling settling;
  EXPECT_FALSE(settling.after(0.5, 1, true));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(settling.after(0.1, 1, false));
}

TEST(Settling, DoesNotCountAnIterationInWhichTheEnergyFallsFast) {
  Settling settling;
  double energy = 1;
  EXPECT_FALSE(settling.after(0.5, energy, true));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(settling.after(0.4, energy *= 0.9, true));
  EXPECT_FALSE(settling.after(0.4, energy *= 0.99, true));
  EXPECT_TRUE(settling.after(0.4, energy *= 0.99, true));
}

}  // namespace
}  // namespace varimesh
