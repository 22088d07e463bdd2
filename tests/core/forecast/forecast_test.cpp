#include "core/forecast/forecast.h"

#include <gtest/gtest.h>

#include <cmath>

namespace varimesh {
namespace {

using Goal = Forecast::Goal;
using Method = Forecast::Method;
constexpr double kRest = 1e-3;

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
  EXPECT_DOUBLE_EQ(forecast.seconds_left(1e6).value(), 0);
}

TEST(Forecast, ExpectsNewtonsMethodToGetEverFaster) {
  Forecast forecast({.goal = Goal::Energy, .tolerance = 1e-6});
  double now = 0;
  for (const double residual : {0.4, 0.2, 0.04})
    forecast.step(Method::Newton, residual, {.now = now += 1, .is_valid = true});
  EXPECT_NEAR(forecast.seconds_left(3).value(), 4, 1) << "3e-3, 8e-5, 2e-6 and 3e-8";
}

TEST(Forecast, ExpectsMoreWhereMoreFollows) {
  const auto after_newton = [](Goal goal, bool is_valid, bool hopes) {
    Forecast forecast({.goal = goal});
    forecast.step(Method::Untangle, 0.01, {.now = 1, .is_valid = is_valid, .hopes = hopes});
    forecast.step(Method::Newton, 0.01, {.now = 2, .is_valid = is_valid, .hopes = hopes});
    return forecast.seconds_left(2).value();
  };
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Minimum, true, false));
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Loss, true, false));
  EXPECT_LT(after_newton(Goal::Energy, true, false), after_newton(Goal::Energy, false, false));
  EXPECT_LT(after_newton(Goal::Loss, true, false), after_newton(Goal::Loss, false, false));
  EXPECT_LT(after_newton(Goal::Loss, false, false), after_newton(Goal::Loss, false, true));
}

TEST(Forecast, SeesTheEndOfRoundsThatGetShorter) {
  Forecast forecast({});
  forecast.descent(10);
  double now = 10, move = 0.8;
  for (int round = 0; round < 6; ++round)
    forecast.round(move *= 0.4, kRest, false, {.now = now += 2, .is_valid = true});
  // 0.0013, … After one more round, all that are left add up to less than kRest.
  EXPECT_NEAR(forecast.seconds_left(now).value(), 2, 2);
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
  forecast.round(2, kRest, false, {.now = 3});
  EXPECT_DOUBLE_EQ(forecast.seconds_left(3).value(), 4 * 3);
  for (int round = 2; round < 10; ++round) forecast.round(2, kRest, false, {.now = 3.0 * round});
  EXPECT_DOUBLE_EQ(forecast.seconds_left(27).value(), 3) << "at least one";
}

TEST(Forecast, GivesOtherWaysAsLongAsTheRunAndSomeMoreIfTheyAreOverdue) {
  Forecast forecast({});
  forecast.other_ways(10);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(10).value(), 10);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(14).value(), 6);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(40).value(), 6);
  forecast.forget();
  EXPECT_FALSE(forecast.seconds_left(40));
}

TEST(Forecast, NeverExceedsTheTimeLimit) {
  Forecast forecast({.time_limit = 5});
  forecast.step(Method::Newton, 1, {.now = 1});
  EXPECT_DOUBLE_EQ(forecast.seconds_left(1).value(), 4);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(9).value(), 0);
}

}  // namespace
}  // namespace varimesh
