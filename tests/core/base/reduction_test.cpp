// Sums that do not depend on how the work is divided.
#include "core/base/reduction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace varimesh {
namespace {

std::vector<double> terms_of_all_sizes(std::size_t count) {
  std::mt19937_64 random(count);
  std::vector<double> terms(count);
  for (double& term : terms)
    term = std::ldexp(static_cast<double>(random()) / 9.2e18 - 1, static_cast<int>(random() % 120) - 60);
  return terms;
}

std::uint64_t bits(double number) { return std::bit_cast<std::uint64_t>(number); }

// Any number of threads, and any size of the pieces that these take.
TEST(Reduction, HasTheSameBitsForAnyDivision) {
  for (const std::size_t count : {0, 1, 7, 255, 256, 257, 4096, 100'003}) {
    const std::vector<double> terms = terms_of_all_sizes(count);
    const auto term = [&](std::size_t i) { return terms[i]; };
    const Team one(1);
    const double expected = Reduction(one).sum(count, 1, term);
    for (const int threads : {1, 2, 3, 16}) {
      const Team team(threads);
      const Reduction reduction(team);
      team.run([&] {
        for (const std::size_t grain : {1, 100, 256, 1000, 4096, 16384, 1 << 20})
          ASSERT_EQ(bits(reduction.sum(count, grain, term)), bits(expected))
              << count << " terms, " << threads << " threads, grain " << grain;
      });
    }
  }
}

TEST(Reduction, AddsEveryTermWithoutRounding) {
  const std::vector<double> terms = terms_of_all_sizes(100'003);
  for (const int threads : {1, 2, 3, 16})
    for (const std::size_t grain : {1, 256, 1 << 20}) {
      const Team team(threads);
      ExactSum sum;
      team.run([&] { sum = Reduction(team).exact(terms.size(), grain, [&](std::size_t i) { return terms[i]; }); });
      EXPECT_EQ(bits(sum.value()), bits(exact_sum(terms).value()));
    }
}

TEST(Reduction, AddsTheBlocksWithoutRounding) {
  const Team team(2);
  // Each block has one term, which a sum of doubles would lose beside its neighbours.
  const std::vector<double> of_block{1e300, 1, -1e300, 1e-30};
  const auto term = [&](std::size_t i) { return i % Reduction::kBlock == 0 ? of_block[i / Reduction::kBlock] : 0.0; };
  EXPECT_EQ(Reduction(team).sum(3 * Reduction::kBlock, 1, term), 1);
  EXPECT_EQ(Reduction(team).sum(of_block.size() * Reduction::kBlock, 1, term), 1);
}

TEST(Reduction, IsNearThePlainSum) {
  const Team team(3);
  const std::size_t count = 50'001;
  EXPECT_EQ(Reduction(team).sum(count, 512, [](std::size_t i) { return static_cast<double>(i); }),
            static_cast<double>(count) * (count - 1) / 2);
}

TEST(Reduction, AsksForWholeBlocksOfTerms) {
  const Team team(2);
  const std::size_t count = 10 * Reduction::kBlock + 3;
  std::atomic<std::size_t> seen{0};
  const double sum = Reduction(team).sum_of_blocks(count, 700, [&](std::size_t begin, std::size_t end) {
    EXPECT_EQ(begin % Reduction::kBlock, 0U);
    EXPECT_EQ(end, std::min(count, begin + Reduction::kBlock));
    seen += end - begin;
    return static_cast<double>(end - begin);
  });
  EXPECT_EQ(seen, count);
  EXPECT_EQ(sum, static_cast<double>(count));
}

TEST(Reduction, KnowsInfinity) {
  const Team team(2);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto sum = [&](double odd_one) {
    return Reduction(team).sum(1000, 64, [&](std::size_t i) { return i == 700 ? odd_one : -1e300; });
  };
  EXPECT_EQ(sum(kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(sum(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Reduction, FindsTheLargest) {
  for (const int threads : {1, 3}) {
    const Team team(threads);
    const Reduction reduction(team);
    const auto term = [](std::size_t i) { return i == 4321 ? -1.0 : -2.0 - static_cast<double>(i); };
    EXPECT_EQ(reduction.largest(10'000, 64, term), 0);
    EXPECT_EQ(reduction.largest(10'000, 64, term, -std::numeric_limits<double>::infinity()), -1);
    EXPECT_EQ(reduction.largest(0, 64, term, 5), 5);
  }
}

}  // namespace
}  // namespace varimesh
