#include "core/forecast/past_forecasts.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(PastForecasts, AgreeWhereTheEndStaysWhereItWas) {
  PastForecasts past;
  for (int second = 1; second <= 90; ++second) {
    past.add(second, 100 - second);
    EXPECT_TRUE(past.agree()) << second;
  }
}

TEST(PastForecasts, TheFirstIsBelieved) {
  PastForecasts past;
  EXPECT_TRUE(past.agree());
  past.add(3, 50);
  EXPECT_TRUE(past.agree());
}

TEST(PastForecasts, DisagreeWhileTheEndMovesAway) {
  PastForecasts past;
  for (int second = 10; second <= 60; second += 10) past.add(second, 12);
  EXPECT_FALSE(past.agree()) << "12 s were left all the time";
}

TEST(PastForecasts, DisagreeWhereTheyFellTooSoon) {
  PastForecasts past;
  past.add(10, 90);
  past.add(20, 80);
  past.add(30, 10);
  EXPECT_FALSE(past.agree()) << "a run that ends at 40 had 20 s left where 80 were said";
}

TEST(PastForecasts, OldFaultsAreForgiven) {
  PastForecasts past;
  past.add(10, 1000);
  past.add(20, 80);
  EXPECT_FALSE(past.agree());
  past.add(25, 75);
  EXPECT_FALSE(past.agree()) << "of the last half, 7.5 s were wrong";
  past.add(50, 50);
  EXPECT_TRUE(past.agree());
}

TEST(PastForecasts, HalfASecondIsNoFault) {
  PastForecasts past;
  past.add(1, 0.6);
  past.add(1.1, 0.1);
  past.add(1.2, 0.3);
  EXPECT_TRUE(past.agree());
}

}  // namespace
}  // namespace varimesh
