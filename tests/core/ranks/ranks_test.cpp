// What ranks do together: one rank, and threads as ranks. tests/client/mpi runs processes.
#include "core/ranks/ranks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "core/ranks/thread_ranks.h"

namespace varimesh {
namespace {

class RanksOf : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Counts, RanksOf, ::testing::Values(1, 2, 3, 8),
                         [](const auto& count) { return std::to_string(count.param); });

TEST_P(RanksOf, AgreeOnSumsAndExtremes) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    const int n = ranks.count(), r = ranks.rank();
    EXPECT_EQ(n, GetParam());
    EXPECT_EQ(ranks.sum(std::int64_t{r}), n * (n - 1) / 2);
    EXPECT_EQ(ranks.sum_before(r + 1), r * (r + 1) / 2);
    EXPECT_EQ(ranks.largest(r - 0.5), n - 1.5);
    EXPECT_EQ(ranks.smallest(r - 0.5), -0.5);
    ExactSum sum;
    for (int i = 0; i < 30; ++i)
      if (i % n == r) sum.add(std::ldexp(1, 10 * i - 150));
    double all = 0;
    for (int i = 29; i >= 0; --i) all += std::ldexp(1, 10 * i - 150);
    EXPECT_EQ(ranks.sum(sum), all);
  });
}

TEST_P(RanksOf, SendListsToEachOther) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    const int n = ranks.count(), r = ranks.rank();
    std::vector<std::vector<int>> to(static_cast<std::size_t>(n));
    for (int other = 0; other < n; ++other) to[static_cast<std::size_t>(other)].assign(std::size_t(r), 10 * r + other);
    const auto came = ranks.exchange_lists(to);
    for (int other = 0; other < n; ++other)
      EXPECT_EQ(came[static_cast<std::size_t>(other)], std::vector<int>(std::size_t(other), 10 * other + r));
    std::vector<int> all;
    for (int i = 0; i < n; ++i) all.push_back(i);
    EXPECT_EQ(ranks.gather(std::vector{r}), r == 0 ? all : std::vector<int>());
    EXPECT_EQ(ranks.gather_everywhere(std::vector{r}), all);
  });
}

TEST_P(RanksOf, StopTogetherAtTheFirstFault) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    EXPECT_TRUE(ranks.together([] {}));
    const int first = ranks.count() / 2;
    const auto done = ranks.together([&]() -> Expected<void> {
      if (ranks.rank() < first) return {};
      return bad_option("rank " + std::to_string(ranks.rank()));
    });
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().sentence, "rank " + std::to_string(first));
    EXPECT_EQ(done.error().kind, Error::Kind::BadOption);
    const auto thrown = ranks.together([&] {
      if (ranks.rank() == ranks.count() - 1) throw std::runtime_error("no more paper");
    });
    ASSERT_FALSE(thrown);
    EXPECT_NE(thrown.error().sentence.find("no more paper"), std::string::npos);
  });
}

TEST(OneRank, IsAlone) {
  EXPECT_EQ(one_rank().count(), 1);
  EXPECT_EQ(one_rank().gather(std::vector{1, 2}), (std::vector{1, 2}));
  EXPECT_EQ(one_rank().sum(std::int64_t{5}), 5);
}

}  // namespace
}  // namespace varimesh
