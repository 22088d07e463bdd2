// The thread budget with real threads.
#include "server/resources/thread_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <latch>

namespace varimesh::server {
namespace {

TEST(ThreadBudget, UsesTheWholeMachineByDefault) { EXPECT_GE(ThreadBudget(0).threads(), 1); }

TEST(ThreadBudget, RunsNoMoreJobsAtATimeThanItHasThreads) {
  ThreadBudget budget(2);
  std::atomic<int> running = 0, most = 0;
  std::latch done(20);
  for (int i = 0; i < 20; ++i)
    budget.launch(1, [&](const LentThreads& threads) {
      const int now = ++running;
      for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
      }
      EXPECT_EQ(threads.now(), 1);
      --running;
      done.count_down();
    });
  done.wait();
  EXPECT_LE(most, 2);
}

TEST(ThreadBudget, GivesASingleJobAllThreadsThatItWants) {
  ThreadBudget budget(4);
  std::latch done(1);
  budget.launch(3, [&](const LentThreads& threads) {
    EXPECT_EQ(threads.now(), 3);
    done.count_down();
  });
  done.wait();
}

}  // namespace
}  // namespace varimesh::server
