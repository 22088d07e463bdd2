// Waiting for memory.
#include "server/resources/memory_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace varimesh::server {
namespace {

using Share = MemoryBudget::Share;
using namespace std::chrono_literals;

bool gives_up() { return true; }
bool waits() { return false; }

TEST(MemoryBudget, KnowsWhichRequestsCanNeverFit) {
  EXPECT_FALSE(MemoryBudget(100).can_ever_fit(101));
  EXPECT_TRUE(MemoryBudget(100).can_ever_fit(100));
  EXPECT_TRUE(MemoryBudget(0).can_ever_fit(std::int64_t{1} << 60));
}

TEST(MemoryBudgetConcurrency, NeverExceedsTheLimitAndKeepsTheOrderAfterAWhile) {
  MemoryBudget budget(100, 0s);
  std::atomic<int> taken = 0, most = 0;
  Share first;
  ASSERT_TRUE(budget.exchange(first, 60, waits));
  std::atomic<bool> large_has_it = false, asked = false;
  std::thread large([&] {
    Share share;
    EXPECT_TRUE(budget.exchange(share, 100, [&] {
      asked = true;
      return false;
    }));
    large_has_it = true;
    budget.give_back(share, 100);
  });
  while (!asked) std::this_thread::yield();
  Share small;
  EXPECT_FALSE(budget.exchange(small, 10, gives_up)) << "it would have fitted, but another was first";
  EXPECT_FALSE(large_has_it);
  budget.give_back(first, 60);
  large.join();
  std::vector<std::thread> jobs;
  for (int job = 0; job < 4; ++job)
    jobs.emplace_back([&, job] {
      Share share;
      for (int i = 0; i < 200; ++i) {
        const int bytes = 20 + (i * 7 + job) % 60;
        ASSERT_TRUE(budget.exchange(share, bytes, waits));
        const int now = taken += bytes;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        taken -= bytes;
        budget.give_back(share, bytes);
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 100);
}

TEST(MemoryBudgetConcurrency, SmallJobsPassALargeOneForSomeTime) {
  MemoryBudget budget(100, 1s);
  Share first;
  ASSERT_TRUE(budget.exchange(first, 60, waits));
  std::atomic<bool> asked = false, ends = false;
  std::thread large([&] {
    Share share;
    EXPECT_FALSE(budget.exchange(share, 100, [&] {
      asked = true;
      return ends.load();
    }));
  });
  while (!asked) std::this_thread::yield();
  Share small;
  EXPECT_TRUE(budget.exchange(small, 40, gives_up));
  budget.give_back(small, 40);
  std::this_thread::sleep_for(1100ms);
  EXPECT_FALSE(budget.exchange(small, 40, gives_up)) << "it has been passed for long enough";
  ends = true;
  large.join();
  EXPECT_TRUE(budget.exchange(small, 40, gives_up)) << "it has given up";
}

TEST(MemoryBudgetConcurrency, TheOwnerWhoHoldsLeastIsNext) {
  MemoryBudget budget(1000);
  Share a{"ann"}, b{"bob"}, more{"ann"}, other{"bob"};
  ASSERT_TRUE(budget.exchange(a, 500, waits));
  ASSERT_TRUE(budget.exchange(b, 250, waits));
  std::atomic<int> order = 0, of_ann = 0, of_bob = 0;
  std::atomic<bool> asked = false;
  std::thread first([&] {
    EXPECT_TRUE(budget.exchange(more, 500, [&] {
      asked = true;
      return false;
    }));
    of_ann = ++order;
    budget.give_back(more, 500);
  });
  while (!asked) std::this_thread::yield();
  asked = false;
  std::thread second([&] {
    EXPECT_TRUE(budget.exchange(other, 500, [&] {
      asked = true;
      return false;
    }));
    of_bob = ++order;
    budget.give_back(other, 500);
  });
  while (!asked) std::this_thread::yield();
  budget.give_back(b, 250);
  budget.give_back(a, 250);
  first.join();
  second.join();
  EXPECT_EQ(of_bob, 1) << "ann asked first, but has 250";
  EXPECT_EQ(of_ann, 2);
}

TEST(MemoryBudget, KeepsAReserveForFirstJobs) {
  constexpr std::int64_t kUnit = std::int64_t{1} << 30;
  MemoryBudget budget(16 * kUnit, 0s);
  Share large{"ann"}, first{"bob"}, second{"bob"}, of_nobody, of_eve{"eve"};
  EXPECT_FALSE(budget.can_ever_fit(15 * kUnit, "ann"));
  EXPECT_TRUE(budget.can_ever_fit(16 * kUnit, "")) << "nobody's jobs may have all";
  ASSERT_TRUE(budget.exchange(large, 14 * kUnit, gives_up));
  EXPECT_FALSE(budget.exchange(of_nobody, 3 * kUnit, gives_up)) << "there are 2";
  EXPECT_FALSE(budget.exchange(first, 3 * kUnit, gives_up)) << "as large as the reserve at most";
  EXPECT_TRUE(budget.exchange(first, kUnit, gives_up));
  EXPECT_TRUE(first.in_reserve);
  EXPECT_FALSE(budget.exchange(second, kUnit, gives_up)) << "it is no first job";
  EXPECT_TRUE(budget.exchange(of_eve, kUnit / 2, gives_up));
  EXPECT_TRUE(budget.exchange(of_eve, kUnit, gives_up)) << "it is still her only job";
  EXPECT_EQ(budget.take_spare(large, kUnit), 0) << "the reserve is not lent to others";
  budget.give_back(large, 14 * kUnit);
  EXPECT_TRUE(budget.exchange(second, kUnit, gives_up));
  EXPECT_FALSE(second.in_reserve);
}

TEST(MemoryBudgetConcurrency, ALargeJobThatWaitsDoesNotDelayAFirstJob) {
  constexpr std::int64_t kUnit = std::int64_t{1} << 30;
  MemoryBudget budget(16 * kUnit, 0s);
  Share running{"ann"}, large{"ann"}, first{"bob"};
  ASSERT_TRUE(budget.exchange(running, kUnit, gives_up));
  std::atomic<bool> asked = false, ends = false;
  std::thread waiting([&] {
    EXPECT_FALSE(budget.exchange(large, 14 * kUnit, [&] {
      asked = true;
      return ends.load();
    }));
  });
  while (!asked) std::this_thread::yield();
  EXPECT_TRUE(budget.exchange(first, kUnit, gives_up));
  ends = true;
  waiting.join();
}

TEST(MemoryBudget, LendsWhatIsFreeIfNobodyWaitsForIt) {
  MemoryBudget budget(100);
  Share share, other, third;
  ASSERT_TRUE(budget.exchange(share, 40, gives_up));
  EXPECT_EQ(budget.take_spare(share, 50), 50);
  EXPECT_EQ(budget.take_spare(share, 50), 10);
  EXPECT_EQ(budget.take_spare(share, 50), 0);
  budget.give_back(share, 60);
  bool was_asked = false;
  EXPECT_FALSE(budget.exchange(other, 70, [&] {
    EXPECT_EQ(budget.take_spare(share, 1), 0) << "another waits for all that is free";
    was_asked = true;
    return true;
  }));
  EXPECT_TRUE(was_asked);
  EXPECT_EQ(budget.take_spare(share, 100), 60);
  EXPECT_EQ(MemoryBudget(0).take_spare(third, 1000), 1000) << "no limit";
}

TEST(MemoryBudget, ServesJobsThatHoldMemoryFirst) {
  MemoryBudget budget(100);
  Share holds, other;
  ASSERT_TRUE(budget.exchange(holds, 40, gives_up));
  EXPECT_FALSE(budget.exchange(other, 70, gives_up)) << "they have 60 left";
  EXPECT_TRUE(budget.exchange(holds, 90, gives_up)) << "its own 40 count for it";
  EXPECT_FALSE(budget.exchange(other, 11, gives_up));
  EXPECT_TRUE(budget.exchange(holds, 10, gives_up)) << "it needs less now";
  EXPECT_TRUE(budget.exchange(other, 90, gives_up));
  EXPECT_FALSE(budget.exchange(holds, 20, gives_up)) << "the other has 90 and runs";
  EXPECT_EQ(holds.bytes, 10) << "who gave up keeps what it had";
  budget.give_back(holds, 10);
  budget.give_back(other, 90);
  EXPECT_TRUE(budget.exchange(other, 100, gives_up));
}

TEST(MemoryBudgetConcurrency, JobsThatAllWaitForMoreDoNotWaitForEver) {
  MemoryBudget budget(100);
  Share shares[2];
  for (Share& share : shares) ASSERT_TRUE(budget.exchange(share, 50, waits));
  std::vector<std::thread> jobs;
  std::atomic<int> done = 0;
  for (Share& share : shares)
    jobs.emplace_back([&] {
      EXPECT_TRUE(budget.exchange(share, 80, waits));
      ++done;
      budget.give_back(share, 80);
    });
  std::thread reader([&] {
    Share share;
    EXPECT_TRUE(budget.exchange(share, 100, waits));
    ++done;
    budget.give_back(share, 100);
  });
  for (std::thread& job : jobs) job.join();
  reader.join();
  EXPECT_EQ(done, 3);
}

}  // namespace
}  // namespace varimesh::server
