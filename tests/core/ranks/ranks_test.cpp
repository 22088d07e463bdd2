// What ranks do together: one rank, and threads as ranks. tests/client/mpi runs processes.
#include "core/ranks/ranks.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>

#include "core/ranks/halo.h"
#include "core/ranks/thread_ranks.h"
#include "core/ranks/to_all.h"
#include "core/ranks/whole_reduction.h"

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

TEST_P(RanksOf, GetWhatTheFirstHas) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    for (const std::size_t size : {std::size_t{1000}, std::size_t{0}, std::size_t{3}}) {
      const auto bytes_of = [&](int rank) {
        Ranks::Bytes bytes(size);
        for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(i + std::size_t(100 * rank) + size);
        return bytes;
      };
      Ranks::Bytes bytes = bytes_of(ranks.rank());
      broadcast(bytes, ranks);
      EXPECT_EQ(bytes, bytes_of(0));
    }
  });
}

TEST_P(RanksOf, KnowWhetherTheyHaveTheSame) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    const bool is_last = ranks.rank() == ranks.count() - 1, alone = ranks.count() == 1;
    EXPECT_TRUE(have_same("AVX2", ranks));
    EXPECT_EQ(have_same(is_last ? "AVX3" : "AVX2", ranks), alone);
    EXPECT_EQ(have_same(is_last ? "" : "AVX2", ranks), alone);
    EXPECT_EQ(have_same(is_last ? "aa" : "a", ranks), alone);
    EXPECT_TRUE(have_same("", ranks));
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

TEST_P(RanksOf, StopAtTheWishOfOne) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    EXPECT_FALSE(ranks.any(false));
    EXPECT_TRUE(ranks.any(ranks.rank() == ranks.count() - 1));
    bool any = true;
    ExactSum sum;
    sum.add(0.5);
    EXPECT_EQ(ranks.sum(sum, false, any), 0.5 * ranks.count());
    EXPECT_FALSE(any);
    EXPECT_EQ(ranks.sum(sum, ranks.rank() == 0, any), 0.5 * ranks.count());
    EXPECT_TRUE(any);
  });
}

/// In a ring, each rank has two items, then one of the rank before and one of the rank after; with one or two ranks
/// there is no ring.
Halo ring(const Ranks& ranks) {
  const int n = ranks.count(), r = ranks.rank();
  std::vector<Halo::Neighbour> neighbours;
  if (n > 2) neighbours = {{(r + n - 1) % n, {{{0}, {2}}}}, {(r + 1) % n, {{{1}, {3}}}}};
  neighbours.push_back({r, {{{}, {}}}});  // without items
  return Halo(std::move(neighbours));
}

TEST_P(RanksOf, ExchangeAHalo) {
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    const int n = ranks.count(), r = ranks.rank();
    const Halo halo = ring(ranks);
    const auto item = [](int rank, int which) { return std::array<float, 2>{float(10 * rank + which), -1.5F}; };
    std::vector<std::array<float, 2>> items{item(r, 0), item(r, 1), {}, {}};
    const Traffic before = ranks.traffic();
    halo.exchange(items.front().data(), 2, ranks);
    EXPECT_EQ(ranks.traffic().messages - before.messages, n > 2 ? 2 : 0);
    EXPECT_EQ(ranks.traffic().bytes - before.bytes, n > 2 ? 16 : 0);
    EXPECT_EQ(ranks.traffic().meetings, before.meetings);
    EXPECT_EQ(halo.items_sent(), n > 2 ? 2 : 0);
    EXPECT_EQ(halo.items_received(), halo.items_sent());
    if (n <= 2) return;
    EXPECT_EQ(items[2], item((r + n - 1) % n, 1));
    EXPECT_EQ(items[3], item((r + 1) % n, 0));
    EXPECT_EQ(items[0], item(r, 0));
  });
}

TEST_P(RanksOf, ReduceWithTheBitsOfOneRank) {
  // Each rank has whole blocks, dealt out in turn; the last one is short.
  constexpr std::size_t kTerms = 9 * Reduction::kBlock + 17;
  std::mt19937 random(5);
  std::vector<double> terms(kTerms);
  for (double& term : terms) term = std::ldexp(double(random()) - 2e9, int(random() % 60) - 80);
  const Team team(1);
  const Reduction reduction(team);
  double sum = 0, largest = 0;
  team.run([&] {
    sum = reduction.sum(kTerms, 1024, [&](std::size_t i) { return terms[i]; });
    largest = reduction.largest(kTerms, 1024, [&](std::size_t i) { return terms[i]; });
  });
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    std::vector<double> mine;
    for (std::size_t i = 0; i < kTerms; ++i)
      if (int(i / Reduction::kBlock) % ranks.count() == ranks.rank()) mine.push_back(terms[i]);
    team.run([&] {
      const WholeReduction whole(team, ranks);
      const auto term = [&](std::size_t i) { return mine[i]; };
      EXPECT_EQ(whole.sum(mine.size(), 1024, term), sum);
      EXPECT_EQ(whole.largest(mine.size(), 1024, term), largest);
    });
  });
}

TEST_P(RanksOf, StopTogether) {
  using enum StopToken::Reason;
  run_as_ranks(GetParam(), [&](const Ranks& ranks) {
    const int last = ranks.count() - 1;
    const StopToken::Agreement agreement = agreement_of(ranks);
    EXPECT_EQ(agreement(None), None);
    EXPECT_EQ(agreement(ranks.rank() == last ? TimeLimit : None), TimeLimit);
    EXPECT_EQ(agreement(ranks.rank() == last ? Asked : TimeLimit), Asked);
    // A sum throws on all ranks if one of them is to stop, and loops between sums on none.
    bool is_asked = false;
    StopToken token([&] { return is_asked && ranks.rank() == last; });
    stop_together(token, ranks);
    Team team(1);
    team.set_stop(&token);
    team.run([&] {
      const std::vector<double> mine(600, 1.0);
      const auto sum = [&] {
        return WholeReduction(team, ranks).sum(mine.size(), 64, [&](std::size_t i) { return mine[i]; });
      };
      EXPECT_EQ(sum(), 600.0 * ranks.count());
      is_asked = true;
      if (ranks.count() > 1) team.for_each(1000, 16, [](std::int32_t) {});
      EXPECT_THROW(sum(), Interrupted);
      EXPECT_EQ(token.reason(), Asked);
    });
  });
}

TEST(OneRank, IsAlone) {
  EXPECT_EQ(one_rank().count(), 1);
  EXPECT_EQ(one_rank().gather(std::vector{1, 2}), (std::vector{1, 2}));
  EXPECT_EQ(one_rank().sum(std::int64_t{5}), 5);
}

}  // namespace
}  // namespace varimesh
