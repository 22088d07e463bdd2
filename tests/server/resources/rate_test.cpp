// How often a caller may do something.
#include "server/resources/rate.h"

#include <gtest/gtest.h>

namespace varimesh::server::testing {
namespace {

class RateTest : public ::testing::Test {
 protected:
  int take(const std::string& caller = "ann") { return rate_.take(caller); }

  Rate::Time now_{std::chrono::hours(1)};
  Rate rate_{60, [this] { return now_; }};
};

TEST_F(RateTest, LetsAMinuteThroughAtOnceAndThenOneASecond) {
  for (int i = 0; i < 60; ++i) EXPECT_EQ(take(), 0) << i;
  EXPECT_EQ(take(), 1);
  EXPECT_EQ(take("bob"), 0);
  now_ += std::chrono::milliseconds(900);
  EXPECT_EQ(take(), 1);
  now_ += std::chrono::milliseconds(100);
  EXPECT_EQ(take(), 0);
  EXPECT_EQ(take(), 1);
  rate_.give_back("ann");
  EXPECT_EQ(take(), 0);
}

TEST_F(RateTest, KnowsNoLimitOfNought) {
  Rate none(0, [this] { return now_; });
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(none.take("ann"), 0);
}

TEST_F(RateTest, RemembersWhoHasUsedUpAllAmongManyCallers) {
  for (int i = 0; i < 60; ++i) take();
  for (int i = 0; i < 5000; ++i) EXPECT_EQ(take(std::to_string(i)), 0);
  EXPECT_GT(take(), 0);
}

}  // namespace
}  // namespace varimesh::server::testing
