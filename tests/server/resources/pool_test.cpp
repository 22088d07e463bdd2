// The pool, used by many threads at the same time.
#include "server/resources/pool.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

TEST(PoolConcurrency, RunsEveryTaskOnce) {
  std::vector<int> runs(2000, 0);
  {
    Pool pool(4);
    std::vector<std::thread> posters;
    for (std::size_t poster = 0; poster < 4; ++poster)
      posters.emplace_back([&, poster] {
        for (std::size_t i = poster; i < runs.size(); i += 4) pool.post([&runs, i] { ++runs[i]; });
      });
    for (std::thread& poster : posters) poster.join();
  }
  for (const int count : runs) EXPECT_EQ(count, 1);
}

TEST(PoolConcurrency, LetsCallersTakeTurns) {
  std::vector<std::string> order;
  std::mutex begun;
  begun.lock();
  {
    Pool pool(1);
    pool.post([&] { const std::lock_guard lock(begun); });
    for (int i = 0; i < 3; ++i) pool.post([&order, i] { order.push_back("mallory " + std::to_string(i)); }, "mallory");
    for (int i = 0; i < 2; ++i) pool.post([&order, i] { order.push_back("ann " + std::to_string(i)); }, "ann");
    begun.unlock();
  }
  EXPECT_EQ(order, (std::vector<std::string>{"mallory 0", "ann 0", "mallory 1", "ann 1", "mallory 2"}));
}

}  // namespace
}  // namespace varimesh::server
