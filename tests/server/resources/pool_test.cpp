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

}  // namespace
}  // namespace varimesh::server
