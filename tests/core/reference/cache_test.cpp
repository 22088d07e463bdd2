// Values that are made once and stay where they are.
#include "core/reference/cache.h"

#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

namespace varimesh::reference {
namespace {

TEST(Cache, MakesAValueOnce) {
  Cache<int, std::string> cache;
  int made = 0;
  const auto make = [&] { return std::to_string(++made); };
  EXPECT_EQ(cache.get(7, make), "1");
  EXPECT_EQ(cache.get(7, make), "1");
  EXPECT_EQ(cache.get(8, make), "2");
}

TEST(Cache, KeepsValuesInPlaceWhileItGrows) {
  Cache<int, std::string> cache;
  const std::string* first = &cache.get(0, [] { return std::string("first"); });
  for (int key = 1; key < 1000; ++key) cache.get(key, [] { return std::string("other"); });
  EXPECT_EQ(&cache.get(0, [] { return std::string("another"); }), first);
  EXPECT_EQ(*first, "first");
}

TEST(Cache, MayAskItselfWhileItMakesAValue) {
  Cache<int, int> factorials;
  struct Maker {
    Cache<int, int>& cache;
    int operator()(int n) const {
      return cache.get(n, [&] { return n < 2 ? 1 : n * (*this)(n - 1); });
    }
  };
  EXPECT_EQ(Maker{factorials}(6), 720);
}

TEST(Cache, GivesAllThreadsTheSameValue) {
  Cache<int, std::vector<int>> cache;
  std::vector<const std::vector<int>*> found(8);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < found.size(); ++i)
    threads.emplace_back([&, i] { found[i] = &cache.get(1, [&] { return std::vector<int>(1000, int(i)); }); });
  for (std::thread& thread : threads) thread.join();
  for (const std::vector<int>* value : found) EXPECT_EQ(value, found[0]);
}

}  // namespace
}  // namespace varimesh::reference
