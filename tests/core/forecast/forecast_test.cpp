#include "core/forecast/forecast.h"

#include <gtest/gtest.h>

#include <cmath>

namespace varimesh {
namespace {

using Goal = Forecast::Goal;
using Method = Forecast::Method;
constexpr double kRest = 1e-3;
/// So short that no forecast is wrong by half a second, and all are told.
constexpr double kShort = 0.01;

TEST(Forecast, KnowsNothingBeforeTheFirstIteration) {
  EXPECT_FALSE(Forecast({}).seconds_left(0));
  EXPECT_FALSE(Forecast({.time_limit = 100}).seconds_left(40));
  EXPECT_DOUBLE_EQ(Forecast({.time_limit = 100}).seconds_left(60).value(), 40) << "more than half has passed";
}

TEST(Forecast, FollowsTheResidualWhereSweepsAreTheOnlyMethod) {
  Forecast forecast({.goal = Goal::Energy, .only_sweeps = true, .tolerance = 1e-3});
  forecast.judged_in(0.5);
  double residual = 0.4;
  for (int sweep = 1; sweep <= 10; ++sweep)
    forecast.step(Method::Sweep, residual *= 0.9, {.now = 2.0 * sweep, .is_valid = true});
  const double more = 2 * std::log(1e-3 / residual) / std::log(0.9) + 0.5;
  EXPECT_NEAR(forecast.seconds_left(20).value(), more, 0.1);
  EXPECT_NEAR(forecast.seconds_left(25).value(), more - 5, 0.1) << "counts down";
  EXPECT_DOUBLE_EQ(forecast.seconds_left(20 + more + 0.4).value(), 0);
  EXPECT_FALSE(forecast.seconds_left(20 + more + 1)) << "the run has lasted longer than was said";
}

TEST(Forecast, ExpectsNewtonsMethodToGetEverFaster) {
  Forecast forecast({.goal = Goal::Energy, .tolerance = 1e-6});
  double now = 0;
  for (const double residual : {0.4, 0.2, 0.04})
    forecast.step(Method::Newton, residual, {.now = now += kShort, .is_valid = true});
  EXPECT_NEAR(forecast.seconds_left(now).value(), 4 * kShort, kShort) << "3e-3, 8e-5, 2e-6 and 3e-8";
}

TEST(Forecast, ExpectsMoreWhereMoreFollows) {
  const auto after_newton = [](Goal goal, bool is_valid, bool hopes) {
    Forecast forecast({.goal = goal});
    // So short that no forecast is far from another.
    forecast.step(Method::Untangle, 0.01, {.now = 0.001, .is_valid = is_valid, .hopes = hopes});
    forecast.step(Method::Newton, 0.01, {.now = 0.002, .is_valid = is_valid, .hopes = hopes});
    return forecast.seconds_left(0.002).value();
  };
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Minimum, true, false));
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Loss, true, false));
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Energy, false, false));
  EXPECT_LT(after_newton(Goal::Loss, true, false), after_newton(Goal::Loss, false, false));
  EXPECT_LT(after_newton(Goal::Loss, false, false), after_newton(Goal::Loss, false, true));
}

TEST(Forecast, SeesTheEndOfRoundsThatGetShorter) {
  Forecast forecast({});
  double now = 10 * kShort, move = 0.8;
  forecast.descent(now);
  for (int round = 0; round < 6; ++round)
    forecast.round(move *= 0.4, kRest, false, {.now = now += 2 * kShort, .is_valid = true});
  // 0.0013, … After one more round, all that are left add up to less than kRest.
  EXPECT_NEAR(forecast.seconds_left(now).value(), 2 * kShort, 2 * kShort);
}

TEST(Forecast, CountsAnotherDescentWhereOneWillFollow) {
  const auto left = [](bool another) {
    Forecast forecast({});
    forecast.descent(0);
    for (int i = 1; i <= 4; ++i) forecast.round(std::pow(0.3, i), kRest, another, {.now = double(i), .is_valid = true});
    return forecast.seconds_left(4).value();
  };
  EXPECT_GT(left(true), left(false) + 3);
}

TEST(Forecast, ExpectsFewRoundsOfAMeshThatStaysInvalid) {
  Forecast forecast({});
  forecast.descent(0);
  forecast.round(2, kRest, false, {.now = 0.03});
  EXPECT_DOUBLE_EQ(forecast.seconds_left(0.03).value(), 4 * 0.03);
  for (int round = 2; round < 10; ++round) forecast.round(2, kRest, false, {.now = 0.03 * round});
  EXPECT_NEAR(forecast.seconds_left(0.27).value(), 0.03, 1e-12) << "at least one";
}

TEST(Forecast, GivesAllOtherWaysAsLongAsTheRunUntilOneHasEnded) {
  Forecast forecast({});
  const auto left = [&](double now) { return forecast.seconds_left(now * kShort).value() / kShort; };
  forecast.other_way(10 * kShort, 4);
  EXPECT_NEAR(left(10), 10, 1e-9);
  EXPECT_NEAR(left(12), 8, 1e-9);
  EXPECT_NEAR(left(15), 0.2 * 5 + 3 * 2.5, 1e-9) << "longer than a fourth of the run";
  forecast.other_way(14 * kShort, 3);
  EXPECT_NEAR(left(14), 3 * 4, 1e-9);
  EXPECT_NEAR(left(16), 3 * 4 - 2, 1e-9);
}

TEST(Forecast, GivesOtherWaysNoMoreThanFiveTimesTheRun) {
  Forecast forecast({});
  forecast.other_way(10 * kShort, 3);
  forecast.other_way(49 * kShort, 2);
  EXPECT_NEAR(forecast.seconds_left(49 * kShort).value(), 11 * kShort, 1e-9) << "in place of 78";
}

TEST(Forecast, BelievesAWholeRunAndDoesNotCountItAmongTheOtherWays) {
  Forecast forecast({.goal = Goal::Minimum});
  forecast.other_way(10 * kShort, 3);
  Forecast& whole = forecast.whole_run(10 * kShort, {.goal = Goal::Energy});
  EXPECT_FALSE(forecast.seconds_left(11 * kShort)) << "before its first iteration";
  whole.step(Method::Newton, 0.2, {.now = 4 * kShort, .is_valid = true});
  EXPECT_GT(whole.seconds_left(4 * kShort).value(), 4 * kShort);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(14 * kShort).value(), whole.seconds_left(4 * kShort).value());
  forecast.other_way(50 * kShort, 2);
  EXPECT_NEAR(forecast.seconds_left(50 * kShort).value() / kShort, 10, 1e-9) << "two ways as long as the run";
}

TEST(Forecast, SaysNothingAfterItWasWrong) {
  Forecast forecast({.goal = Goal::Energy});
  double now = 0;
  for (const double seconds : {1.0, 1.0, 1.0, 40.0})
    forecast.step(Method::Newton, 1e-2, {.now = now += seconds, .is_valid = true});
  EXPECT_FALSE(forecast.seconds_left(now)) << "the last step took longer than all that was left";
}

TEST(Forecast, CanForget) {
  Forecast forecast({});
  forecast.step(Method::Newton, 1, {.now = 1});
  EXPECT_TRUE(forecast.seconds_left(1));
  forecast.forget();
  EXPECT_FALSE(forecast.seconds_left(1));
}

TEST(Forecast, NeverExceedsTheTimeLimit) {
  Forecast forecast({.time_limit = 5});
  forecast.step(Method::Newton, 1, {.now = 1});
  EXPECT_DOUBLE_EQ(forecast.seconds_left(1).value(), 4);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(9).value(), 0);
}

}  // namespace
}  // namespace varimesh
