// Numbers in 16 bits are rounded to the nearest step and never overflow.
#include "core/kernels/hessian/fixed_point_16.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(FixedPoint16, RoundsToTheNearestStep) {
  EXPECT_EQ(to_fixed_point(0), 0);
  EXPECT_EQ(to_fixed_point(0.49), 0);
  EXPECT_EQ(to_fixed_point(0.51), 1);
  EXPECT_EQ(to_fixed_point(-0.51), -1);
  EXPECT_EQ(to_fixed_point(12345.4), 12345);
}

TEST(FixedPoint16, HoldsWholeStepsExactly) {
  for (int steps = -32767; steps <= 32767; ++steps) ASSERT_EQ(to_fixed_point(steps), steps);
}

TEST(FixedPoint16, MakesTheLargestOfWhatIsLarger) {
  EXPECT_EQ(kLargestFixedPoint, 32767);
  for (const double steps : {32767.4, 32768.0, 1e6, 1e300}) {
    EXPECT_EQ(to_fixed_point(steps), 32767);
    EXPECT_EQ(to_fixed_point(-steps), -32767) << "and not −32768, so that both signs are alike";
  }
}

}  // namespace
}  // namespace varimesh
