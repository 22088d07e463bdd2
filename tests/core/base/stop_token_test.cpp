// A token stops work for a question or a time limit, and a team's work ends soon after it.
#include "core/base/stop_token.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

#include "core/base/team.h"

namespace varimesh {
namespace {

TEST(StopToken, StopsNeverByItself) {
  const StopToken token;
  EXPECT_FALSE(token.stopped());
  EXPECT_EQ(token.reason(), StopToken::Reason::None);
  EXPECT_NO_THROW(token.look());
  look(nullptr);
}

TEST(StopToken, StopsWhenItsQuestionSaysSoAndAsksNoMore) {
  int asked = 0;
  const StopToken token([&] { return ++asked == 3; });
  EXPECT_FALSE(token.stopped());
  EXPECT_FALSE(token.stopped());
  EXPECT_THROW(token.look(), Interrupted);
  EXPECT_TRUE(token.stopped());
  EXPECT_EQ(token.reason(), StopToken::Reason::Asked);
  EXPECT_EQ(asked, 3);
}

TEST(StopToken, StopsAtItsTimeLimit) {
  StopToken token;
  token.stop_after(1e6);
  EXPECT_FALSE(token.stopped());
  token.stop_after(1e300);
  EXPECT_FALSE(token.stopped());
  token.stop_after(-1);
  EXPECT_EQ(token.reason(), StopToken::Reason::None) << "nobody has looked";
  EXPECT_TRUE(token.stopped());
  EXPECT_EQ(token.reason(), StopToken::Reason::TimeLimit);
}

TEST(StopToken, LeavesItToAllIfThereIsAnAgreement) {
  using enum StopToken::Reason;
  bool others_wish = false;
  std::vector<StopToken::Reason> wishes;
  StopToken token;
  token.stop_together([&](StopToken::Reason mine) {
    wishes.push_back(mine);
    return others_wish ? Asked : None;
  });
  token.look_together();
  token.stop_after(-1);
  EXPECT_EQ(token.wish(), TimeLimit);
  EXPECT_FALSE(token.stopped()) << "the others do not know";
  EXPECT_FALSE(token.stopped_together()) << "the others say no";
  EXPECT_EQ(wishes, (std::vector{None, TimeLimit}));
  others_wish = true;
  EXPECT_FALSE(token.stopped());
  EXPECT_THROW(token.look_together(), Interrupted);
  EXPECT_TRUE(token.stopped());
  EXPECT_EQ(token.reason(), Asked);
  EXPECT_TRUE(token.stopped_together());
  EXPECT_EQ(wishes.size(), 3U) << "nobody asks twice";
}

TEST(StopToken, LooksByItselfWithoutAnAgreement) {
  StopToken token;
  EXPECT_FALSE(token.stopped_together());
  token.stop_after(-1);
  EXPECT_TRUE(token.stopped_together());
  Team team(1);
  team.look_together();
  team.set_stop(&token);
  EXPECT_THROW(team.look_together(), Interrupted);
}

TEST(TeamWithAToken, LeavesWhatIsLeft) {
  for (const int threads : {1, 4}) {
    std::atomic<int> done = 0;
    const StopToken token([&] { return done >= 100; });
    Team team(threads);
    team.set_stop(&token);
    EXPECT_THROW(team.run([&] { team.for_each(1'000'000, 32, [&](std::int32_t) { ++done; }); }), Interrupted);
    // Two pieces of work lie between two looks: one before it and one that another thread had begun.
    EXPECT_LE(done, 100 + 2 * 2 * threads) << threads << " threads";
    EXPECT_GE(done, 100);
  }
}

TEST(TeamWithAToken, CutsRangesIntoPieces) {
  for (const int threads : {1, 4}) {
    std::atomic<std::size_t> done = 0;
    const StopToken token([&] { return done > 0; });
    Team team(threads);
    team.set_stop(&token);
    EXPECT_THROW(team.run([&] {
      team.for_ranges(64'000, 10, [&](std::size_t begin, std::size_t end) { done += end - begin; });
    }),
                 Interrupted);
    EXPECT_LE(done, 1001u * static_cast<std::size_t>(threads)) << threads << " threads";
  }
}

TEST(TeamWithAToken, CoversEverythingIfItIsNotStopped) {
  const StopToken token([] { return false; });
  for (const int threads : {1, 4})
    for (const std::size_t count : {0U, 1U, 7U, 1000U, 1001U}) {
      Team team(threads);
      team.set_stop(&token);
      std::vector<std::atomic<int>> calls(count);
      team.run([&] {
        team.for_ranges(count, 3, [&](std::size_t begin, std::size_t end) {
          EXPECT_LT(begin, end);
          for (std::size_t i = begin; i < end; ++i) ++calls[i];
        });
        team.for_each(static_cast<std::int32_t>(count), 40,
                      [&](std::int32_t i) { ++calls[static_cast<std::size_t>(i)]; });
      });
      for (const auto& number : calls) EXPECT_EQ(number, 2) << threads << " threads";
    }
}

TEST(TeamWithAToken, HasATwinThatIsNeverStopped) {
  const StopToken token([] { return true; });
  Team team(2);
  team.set_stop(&token);
  int done = 0;
  EXPECT_NO_THROW(team.without_stop().for_each(5, 1, [&](std::int32_t) { ++done; }));
  EXPECT_EQ(done, 5);
  EXPECT_EQ(team.without_stop().threads(), 2);
  EXPECT_THROW(team.look(), Interrupted);
  team.set_stop(nullptr);
  EXPECT_NO_THROW(team.look());
}

}  // namespace
}  // namespace varimesh
