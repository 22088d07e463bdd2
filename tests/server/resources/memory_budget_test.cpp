// Waiting for memory.
#include "server/resources/memory_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace varimesh::server {
namespace {

TEST(MemoryBudget, KnowsWhichRequestsCanNeverFit) {
  EXPECT_FALSE(MemoryBudget(100).can_ever_fit(101));
  EXPECT_TRUE(MemoryBudget(100).can_ever_fit(100));
  EXPECT_TRUE(MemoryBudget(0).can_ever_fit(std::int64_t{1} << 60));
}

TEST(MemoryBudgetConcurrency, NeverExceedsTheLimitAndKeepsTheOrder) {
  MemoryBudget budget(100);
  std::atomic<int> taken = 0, most = 0;
  ASSERT_TRUE(budget.take(60, [] { return false; }));
  std::atomic<bool> large_has_it = false, asked = false;
  std::thread large([&] {
    EXPECT_TRUE(budget.take(100, [&] {
      asked = true;
      return false;
    }));
    large_has_it = true;
    budget.give_back(100);
  });
  while (!asked) std::this_thread::yield();
  EXPECT_FALSE(budget.take(10, [] { return true; })) << "it would have fitted, but another was first";
  EXPECT_FALSE(large_has_it);
  budget.give_back(60);
  large.join();
  std::vector<std::thread> jobs;
  for (int job = 0; job < 4; ++job)
    jobs.emplace_back([&, job] {
      for (int i = 0; i < 200; ++i) {
        const int bytes = 20 + (i * 7 + job) % 60;
        ASSERT_TRUE(budget.take(bytes, [] { return false; }));
        const int now = taken += bytes;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        taken -= bytes;
        budget.give_back(bytes);
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 100);
}

TEST(MemoryBudget, LendsWhatIsFreeIfNobodyWaitsForIt) {
  MemoryBudget budget(100);
  ASSERT_TRUE(budget.take(40, [] { return true; }));
  EXPECT_EQ(budget.take_spare(50), 50);
  EXPECT_EQ(budget.take_spare(50), 10);
  EXPECT_EQ(budget.take_spare(50), 0);
  budget.give_back(60);
  bool was_asked = false;
  EXPECT_FALSE(budget.take(70, [&] {
    EXPECT_EQ(budget.take_spare(1), 0) << "another waits for all that is free";
    was_asked = true;
    return true;
  }));
  EXPECT_TRUE(was_asked);
  EXPECT_EQ(budget.take_spare(100), 60);
  EXPECT_EQ(MemoryBudget(0).take_spare(1000), 1000) << "no limit";
}

TEST(MemoryBudget, ServesJobsThatHoldMemoryFirst) {
  MemoryBudget budget(100);
  const auto give_up = [] { return true; };
  ASSERT_TRUE(budget.take(40, give_up));
  EXPECT_FALSE(budget.take(70, give_up)) << "they have 60 left";
  EXPECT_TRUE(budget.exchange(40, 90, give_up)) << "its own 40 count for it";
  EXPECT_FALSE(budget.take(11, give_up));
  EXPECT_TRUE(budget.exchange(90, 10, give_up)) << "it needs less now";
  EXPECT_TRUE(budget.take(90, give_up));
  EXPECT_FALSE(budget.exchange(10, 20, give_up)) << "the other has 90 and runs";
  budget.give_back(100);
  EXPECT_TRUE(budget.take(100, give_up)) << "who gave up kept its 10";
}

TEST(MemoryBudgetConcurrency, JobsThatAllWaitForMoreDoNotWaitForEver) {
  MemoryBudget budget(100);
  ASSERT_TRUE(budget.take(50, [] { return false; }));
  ASSERT_TRUE(budget.take(50, [] { return false; }));
  std::vector<std::thread> jobs;
  std::atomic<int> done = 0;
  for (int job = 0; job < 2; ++job)
    jobs.emplace_back([&] {
      EXPECT_TRUE(budget.exchange(50, 80, [] { return false; }));
      ++done;
      budget.give_back(80);
    });
  std::thread reader([&] {
    EXPECT_TRUE(budget.take(100, [] { return false; }));
    ++done;
    budget.give_back(100);
  });
  for (std::thread& job : jobs) job.join();
  reader.join();
  EXPECT_EQ(done, 3);
}

}  // namespace
}  // namespace varimesh::server
