// Threads, shared by jobs that begin and end.
#include "server/resources/thread_shares.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace varimesh::server {
namespace {

TEST(ThreadShares, LendThreadsToNewJobsAndReturnThem) {
  ThreadShares shares(8);
  const auto large = shares.take(8);
  EXPECT_EQ(large->threads(), 8);
  {
    const auto small = shares.take(1), other = shares.take(8);
    EXPECT_EQ(small->threads(), 1);
    EXPECT_EQ(large->threads(), 4);
    EXPECT_EQ(other->threads(), 3);
  }
  EXPECT_EQ(large->threads(), 8);
}

TEST(ThreadShares, LendTheThreadsOfRestingJobs) {
  ThreadShares shares(4);
  const auto works = shares.take(4), waits = shares.take(4);
  EXPECT_EQ(works->threads(), 2);
  waits->rest(true);
  EXPECT_EQ(works->threads(), 4);
  EXPECT_EQ(shares.take(1)->threads(), 1) << "other jobs begin and end meanwhile";
  waits->rest(false);
  EXPECT_EQ(works->threads() + waits->threads(), 4);
}

TEST(ThreadShares, GiveEveryJobAtLeastOneThread) {
  ThreadShares shares(2);
  const auto a = shares.take(2), b = shares.take(2), c = shares.take(2);
  EXPECT_EQ(a->threads() + b->threads() + c->threads(), 3);
}

TEST(ThreadSharesConcurrency, NeverExceedTheBudget) {
  ThreadShares shares(6);
  std::atomic<int> most = 0;
  std::vector<std::thread> jobs;
  for (int job = 0; job < 4; ++job)
    jobs.emplace_back([&, job] {
      for (int i = 0; i < 500; ++i) {
        const auto share = shares.take(1 + (i + job) % 6);
        if (share->threads() > most) most = share->threads();
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 6);
  EXPECT_EQ(shares.take(6)->threads(), 6);
}

}  // namespace
}  // namespace varimesh::server
