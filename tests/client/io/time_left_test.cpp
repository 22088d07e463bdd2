#include "client/io/time_left.h"

#include <gtest/gtest.h>

namespace varimesh::client {
namespace {

using std::chrono::seconds;

const TimeLeft::Clock::time_point kNow{seconds(1000)};

v1::Iteration iteration(double passed, double left) {
  v1::Iteration message;
  message.set_seconds(passed);
  message.set_seconds_left(left);
  return message;
}

TEST(TimeLeft, CountsDownWhatTheLastMessageSaid) {
  TimeLeft left;
  EXPECT_FALSE(left.seconds(kNow)) << "nothing was said";
  left.note(iteration(5, 30), kNow);
  EXPECT_DOUBLE_EQ(left.seconds(kNow).value(), 30);
  EXPECT_DOUBLE_EQ(left.seconds(kNow + seconds(10)).value(), 20);
  EXPECT_DOUBLE_EQ(left.seconds(kNow + seconds(30)).value(), 0);
  EXPECT_FALSE(left.seconds(kNow + seconds(40))) << "later than expected";
  v1::Work work;
  work.set_seconds_left(3);
  left.note(work, kNow + seconds(10));
  EXPECT_DOUBLE_EQ(left.seconds(kNow + seconds(11)).value(), 2);
}

TEST(TimeLeft, IsUnknownIfTheLastMessageDoesNotSay) {
  TimeLeft left;
  left.note(iteration(5, 30), kNow);
  left.note(v1::Iteration(), kNow);
  EXPECT_FALSE(left.seconds(kNow));
}

TEST(TimeLeft, KnowsTheShareOfTheTimeThatHasPassedAndThatNeverFalls) {
  TimeLeft left;
  EXPECT_FALSE(left.share(kNow));
  left.note(iteration(10, 30), kNow);
  EXPECT_DOUBLE_EQ(left.share(kNow).value(), 0.25);
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(10)).value(), 0.5);
  left.note(iteration(20, 180), kNow + seconds(10));
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(10)).value(), 0.5) << "the end has moved away";
  left.note(v1::Iteration(), kNow + seconds(11));
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(11)).value(), 0.5) << "nothing is known any more";
  left.note(iteration(30, 10), kNow + seconds(20));
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(50)).value(), 1) << "later than expected";
}

TEST(TimeLeft, TheShareGrowsEverSlowerWhileTheEndIsUnknown) {
  TimeLeft left;
  left.note(iteration(10, 30), kNow);
  EXPECT_DOUBLE_EQ(left.share(kNow).value(), 0.25);
  v1::Iteration silent;
  silent.set_seconds(20);
  left.note(silent, kNow + seconds(10));
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(10)).value(), 0.25 + 0.75 * (1 - 10.0 / 20));
  EXPECT_DOUBLE_EQ(left.share(kNow + seconds(30)).value(), 0.25 + 0.75 * (1 - 10.0 / 40));
  EXPECT_LT(left.share(kNow + seconds(100000)).value(), 1);
}

TEST(TimeLeft, TakesNumbersThatNoClockCanCount) {
  TimeLeft left;
  left.note(iteration(1e300, 1e300), kNow);
  EXPECT_GT(left.seconds(kNow).value(), 1e8);
}

}  // namespace
}  // namespace varimesh::client
