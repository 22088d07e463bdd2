// A team calls every index once, on no more threads than it has, and hands on what is thrown.
#include "core/base/team.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace varimesh {
namespace {

TEST(Team, OfZeroHasTheMachinesThreads) {
  EXPECT_EQ(Team(0).threads(), machine_threads());
  EXPECT_EQ(Team(3).threads(), 3);
  Team team(3);
  team.set_threads(1);
  EXPECT_EQ(team.threads(), 1);
}

TEST(Team, ForEachCallsEveryIndexOnce) {
  for (const int threads : {1, 4})
    for (const std::int32_t count : {0, 1, 7, 1000}) {
      const Team team(threads);
      std::vector<std::atomic<int>> calls(static_cast<std::size_t>(count));
      team.run([&] { team.for_each(count, 8, [&](std::int32_t i) { ++calls[static_cast<std::size_t>(i)]; }); });
      for (const auto& number : calls) EXPECT_EQ(number, 1) << threads << " threads";
    }
}

TEST(Team, ForRangesCoversEveryIndexOnceWithoutEmptyRanges) {
  for (const int threads : {1, 4})
    for (const std::size_t count : {0U, 1U, 7U, 1000U}) {
      const Team team(threads);
      std::vector<std::atomic<int>> calls(count);
      team.run([&] {
        team.for_ranges(count, 8, [&](std::size_t begin, std::size_t end) {
          EXPECT_LT(begin, end);
          for (std::size_t i = begin; i < end; ++i) ++calls[i];
        });
      });
      for (const auto& number : calls) EXPECT_EQ(number, 1) << threads << " threads";
    }
}

TEST(Team, RunsInTheCaller) {
  for (const int threads : {1, 3}) {
    std::thread::id ran_in;
    Team(threads).run([&] { ran_in = std::this_thread::get_id(); });
    EXPECT_EQ(ran_in, std::this_thread::get_id());
  }
}

TEST(Team, SharesALoopOutsideOfRunToo) {
  const Team team(3);
  std::atomic<int> sum{0};
  team.for_each(1000, 8, [&](std::int32_t) { ++sum; });
  EXPECT_EQ(sum, 1000);
}

TEST(Team, UsesNoMoreThreadsThanItHas) {
  const Team team(2);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  std::atomic<int> inside = 0, most = 0;
  team.run([&] {
    team.for_each(200, 1, [&](std::int32_t) {
      const int now = ++inside;
      for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
      }
      {
        const std::scoped_lock lock(mutex);
        threads.insert(std::this_thread::get_id());
      }
      --inside;
    });
  });
  EXPECT_LE(most, 2);
  EXPECT_LE(threads.size(), 2U);
}

TEST(Team, ThrowsInTheCallerWhatTheBodyThrows) {
  for (const int threads : {1, 3})
    EXPECT_THROW(Team(threads).run([] { throw std::runtime_error("broken"); }), std::runtime_error);
}

}  // namespace
}  // namespace varimesh
