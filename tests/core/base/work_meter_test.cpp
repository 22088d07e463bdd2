// A meter reports at most ten times per second, one call at a time, and what it reports is true.
#include "core/base/work_meter.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "core/base/team.h"

namespace varimesh {
namespace {

TEST(WorkMeter, ReportsTheFirstWorkAtOnceAndTheRestWhenItIsDue) {
  std::vector<Work> reports;
  WorkMeter meter([&](const Work& work) { reports.push_back(work); });
  meter.begin(Activity::Assembly, 1000);
  for (int i = 0; i < 500; ++i) meter.add(2);
  ASSERT_FALSE(reports.empty());
  EXPECT_EQ(reports[0].activity, Activity::Assembly);
  EXPECT_EQ(reports[0].done, 2);
  EXPECT_EQ(reports[0].of, 1000);
  EXPECT_EQ(reports[0].groups_left, -1);
  EXPECT_LT(reports.size(), 50u);

  std::this_thread::sleep_for(WorkMeter::kInterval);
  const std::size_t before = reports.size();
  meter.found_groups(7);
  meter.begin(Activity::Products);
  meter.add();
  ASSERT_EQ(reports.size(), before + 1);
  EXPECT_EQ(reports.back().activity, Activity::Products);
  EXPECT_EQ(reports.back().done, 1) << "a new piece of work starts from nothing";
  EXPECT_EQ(reports.back().of, 0);
  EXPECT_EQ(reports.back().groups_left, 7);
}

TEST(WorkMeter, CountsTheSecondsDownUntilTheExpectedEnd) {
  std::vector<Work> reports;
  WorkMeter meter([&](const Work& work) { reports.push_back(work); });
  const auto seconds_left = [&] {
    std::this_thread::sleep_for(WorkMeter::kInterval);
    meter.add();
    return reports.back().seconds_left;
  };
  EXPECT_EQ(seconds_left(), -1) << "nobody has told";
  meter.expect_end_in(100);
  const double left = seconds_left();
  EXPECT_TRUE(left > 50 && left < 100) << left;
  EXPECT_LT(seconds_left(), left);
  meter.expect_end_in(0);
  EXPECT_EQ(seconds_left(), 0) << "later than expected";
  meter.expect_end_in(-1);
  EXPECT_EQ(seconds_left(), -1);
}

TEST(WorkMeter, ReportsAtMostTenTimesPerSecondWhateverTheThreads) {
  using Clock = std::chrono::steady_clock;
  using std::chrono::milliseconds;
  std::atomic<int> inside = 0, reports = 0;
  std::int64_t last = 0;
  WorkMeter meter([&](const Work& work) {
    EXPECT_EQ(++inside, 1) << "one call at a time";
    EXPECT_GE(work.done, last);
    last = work.done;
    ++reports;
    --inside;
  });
  constexpr std::int32_t kThreads = 16;  // more than there are processors, so that some wait while others report
  meter.begin(Activity::Sweep, kThreads);
  const Team team(kThreads);
  const auto begin = Clock::now();
  // Beside busy programs all threads may wait for longer than an interval.
  const auto goes_on = [&] {
    const auto passed = Clock::now() - begin;
    return passed < milliseconds(450) || (reports < 2 && passed < milliseconds(60'000));
  };
  team.run([&] {
    team.for_each(kThreads, 1, [&](std::int32_t) {
      while (goes_on()) meter.add();
    });
  });
  EXPECT_GE(reports, 2);
  EXPECT_LE(reports, (Clock::now() - begin) / WorkMeter::kInterval + 1);
}

TEST(WorkMeter, AddsUpWhatTheKernelsDoWhateverTheThreads) {
  WorkMeter meter([](const Work&) { FAIL() << "nobody waits for kernels"; });
  EXPECT_EQ(meter.kernels().operations, 0);
  EXPECT_EQ(meter.kernels().seconds, 0);
  const Team team(4);
  team.run([&] { team.for_each(10'000, 1, [&](std::int32_t i) { meter.add_kernels({double(i), 0.25}); }); });
  EXPECT_EQ(meter.kernels().operations, 9'999 * 5'000.0);
  EXPECT_EQ(meter.kernels().seconds, 2'500);
}

}  // namespace
}  // namespace varimesh
