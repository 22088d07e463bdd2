// Shared loops give the same for every number of threads.
#include "core/base/shared_work.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <string>

namespace varimesh {
namespace {

constexpr int kThreads[] = {1, 2, 3, 16};

TEST(SharedWork, CutsChunksThatDoNotDependOnTheThreads) {
  for (const int threads : kThreads)
    for (const std::size_t count : {0U, 1U, 9U, 10U, 11U, 1000U}) {
      const Team team(threads);
      std::vector<std::pair<std::size_t, std::size_t>> chunks(chunks_of(count, 10));
      team.run([&] {
        for_chunks(team, count, 10, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
          chunks[chunk] = {begin, end};
        });
      });
      for (std::size_t c = 0; c < chunks.size(); ++c)
        EXPECT_EQ(chunks[c], std::pair(10 * c, std::min(10 * c + 10, count)));
    }
}

TEST(SharedWork, FindsTheFirstOfSeveral) {
  for (const int threads : kThreads) {
    const Team team(threads);
    for (const std::size_t first : {0U, 5U, 4999U, 9999U, 10000U}) {
      std::size_t found = 0;
      team.run(
          [&] { found = first_of(team, 10000, 8, [&](std::size_t i) { return i >= first && i % 5 == first % 5; }); });
      EXPECT_EQ(found, first) << threads << " threads";
    }
  }
}

TEST(SharedWork, CountsAndLowersTogether) {
  for (const int threads : kThreads) {
    const Team team(threads);
    std::vector<std::int32_t> counts(7, 0), least(7, 1 << 30), firsts(7, 0);
    team.run([&] {
      team.for_each(70000, 16, [&](std::int32_t i) {
        count_up(counts[static_cast<std::size_t>(i % 7)], team);
        if (lower_to(least[static_cast<std::size_t>(i % 7)], i, team) == 1 << 30)
          count_up(firsts[static_cast<std::size_t>(i % 7)], team);
      });
    });
    EXPECT_EQ(firsts, std::vector<std::int32_t>(7, 1)) << "one call replaces the first number";
    for (std::int32_t k = 0; k < 7; ++k) {
      EXPECT_EQ(counts[static_cast<std::size_t>(k)], 10000);
      EXPECT_EQ(least[static_cast<std::size_t>(k)], k);
    }
  }
}

TEST(SharedWork, SortsAsTheStandardLibraryDoes) {
  std::vector<std::int32_t> numbers(100000);
  std::iota(numbers.begin(), numbers.end(), 0);
  std::shuffle(numbers.begin(), numbers.end(), std::mt19937(1));
  for (const int threads : kThreads) {
    const Team team(threads);
    std::vector<std::int32_t> sorted = numbers;
    team.run([&] { sort_distinct(team, sorted); });
    EXPECT_TRUE(std::is_sorted(sorted.begin(), sorted.end()));
  }
}

TEST(SharedWork, CountsAndListsWhatItIsAskedFor) {
  const auto is = [](std::size_t i) { return i % 7 == 3 || (i > 2000 && i < 2100); };
  for (const std::size_t count : {0U, 3U, 4U, 999U, 10'000U}) {
    std::vector<std::int32_t> plain;
    for (std::size_t i = 0; i < count; ++i)
      if (is(i)) plain.push_back(static_cast<std::int32_t>(i));
    for (const int threads : kThreads)
      for (const std::size_t grain : {1U, 64U, 100'000U}) {
        const Team team(threads);
        team.run([&] {
          EXPECT_EQ(count_where(team, count, grain, is), std::ssize(plain));
          EXPECT_EQ(indices_where(team, count, grain, is), plain);
        });
      }
  }
}

TEST(SharedWork, TurnsCountsIntoBeginnings) {
  std::vector<int> numbers{3, 0, 5};
  EXPECT_EQ(sums_before(numbers), 8);
  EXPECT_EQ(numbers, (std::vector<int>{0, 3, 3}));
}

TEST(InOrder, TakesEveryPieceInOrder) {
  for (const int threads : kThreads) {
    const Team team(threads);
    int next = 0;
    std::atomic<int> in_memory{0}, most{0};
    std::vector<std::string> taken;
    team.run([&] {
      in_order(
          team, [&] { return next < 500 ? std::optional(next++) : std::nullopt; },
          [&](int piece) {
            const int now = ++in_memory;
            for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
            }
            return std::to_string(piece);
          },
          [&](const std::string& made) {
            --in_memory;
            taken.push_back(made);
            return true;
          });
    });
    ASSERT_EQ(taken.size(), 500U) << threads << " threads";
    for (int i = 0; i < 500; ++i) EXPECT_EQ(taken[static_cast<std::size_t>(i)], std::to_string(i));
    EXPECT_LE(most, threads + 2);
  }
}

TEST(InOrder, TakesNothingAfterTheFirstRefusal) {
  for (const int threads : kThreads) {
    const Team team(threads);
    int next = 0, taken = 0;
    team.run([&] {
      in_order(
          team, [&] { return next < 500 ? std::optional(next++) : std::nullopt; }, [](int piece) { return piece; },
          [&](int piece) {
            ++taken;
            return piece < 7;
          });
    });
    EXPECT_EQ(taken, 8) << threads << " threads";
  }
}

}  // namespace
}  // namespace varimesh
