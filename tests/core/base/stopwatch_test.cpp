// A stopwatch runs forwards, and may have been started earlier.
#include "core/base/stopwatch.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(Stopwatch, BeginsAtZeroAndNeverGoesBack) {
  const Stopwatch watch;
  double last = watch.seconds();
  EXPECT_GE(last, 0);
  EXPECT_LT(last, 60);
  for (int i = 0; i < 1000; ++i) {
    const double now = watch.seconds();
    EXPECT_GE(now, last);
    last = now;
  }
}

TEST(Stopwatch, GoesOnFromTheSecondsOfAnEarlierOne) {
  const Stopwatch fresh, older = Stopwatch::started(1234.5);
  EXPECT_GE(older.seconds(), 1234.5);
  EXPECT_LT(older.seconds(), 1234.5 + 60);
  EXPECT_NEAR(older.seconds() - fresh.seconds(), 1234.5, 1);
}

}  // namespace
}  // namespace varimesh
