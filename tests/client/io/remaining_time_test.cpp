#include "client/io/remaining_time.h"

#include <gtest/gtest.h>

#include <cmath>

namespace varimesh::client {
namespace {

v1::Options for_energy() {
  v1::Options options;
  options.set_objective(v1::OBJECTIVE_ENERGY);
  return options;
}

v1::Iteration iteration(int number, double seconds, double residual, v1::Phase phase = v1::PHASE_SWEEPS) {
  v1::Iteration made;
  made.set_number(number);
  made.set_seconds(seconds);
  made.set_residual(residual);
  made.set_phase(phase);
  return made;
}

TEST(RemainingTime, FollowsTheResidualOfThePhase) {
  v1::Options options;
  options.set_tolerance(1e-6);  // which asks for the energy's optimum
  RemainingTime remaining(options);
  for (int i = 1; i <= 4; ++i) {
    EXPECT_FALSE(i < 4 && remaining.seconds());
    remaining.add(iteration(i, i, std::pow(10.0, -i)));  // one decade per second
  }
  ASSERT_TRUE(remaining.seconds());
  EXPECT_NEAR(*remaining.seconds(), 2, 1e-9);
  remaining.add(iteration(5, 5, 1e-4, v1::PHASE_NEWTON));
  EXPECT_FALSE(remaining.seconds());
}

TEST(RemainingTime, NeverRises) {
  RemainingTime remaining(for_energy());
  double least = 1e9;
  int shown = 0;
  for (int i = 1; i <= 60; ++i) {  // falls, more and more slowly, and rises now and then
    remaining.add(iteration(i, i, std::pow(10.0, -2 * std::sqrt(i) + std::sin(i))));
    if (!remaining.seconds()) continue;
    EXPECT_LE(*remaining.seconds(), least) << i;
    least = *remaining.seconds();
    ++shown;
  }
  EXPECT_GT(shown, 0);
}

TEST(RemainingTime, IsUnknownIfTheResidualStandsStill) {
  RemainingTime remaining(for_energy());
  for (int i = 1; i <= 8; ++i) remaining.add(iteration(i, i, 0.1));
  EXPECT_FALSE(remaining.seconds());
}

TEST(RemainingTime, IsUnknownWithTheObjectivesWorstAndAccuracyAndByDefault) {
  for (const v1::Objective objective :
       {v1::OBJECTIVE_WORST, v1::OBJECTIVE_ACCURACY, v1::OBJECTIVE_AUTO, v1::OBJECTIVE_UNSPECIFIED}) {
    v1::Options options;
    options.set_objective(objective);
    RemainingTime remaining(options);
    for (int i = 1; i <= 8; ++i) remaining.add(iteration(i, i, std::pow(10.0, -i)));
    EXPECT_FALSE(remaining.seconds());
    options.set_time_limit(9);
    RemainingTime limited(options);
    for (int i = 1; i <= 8; ++i) limited.add(iteration(i, i, std::pow(10.0, -i)));
    EXPECT_NEAR(limited.seconds().value_or(-1), 1, 1e-9);
  }
}

TEST(RemainingTime, IsLimitedByIterationsAndTime) {
  v1::Options options = for_energy();
  options.set_max_iterations(10);
  RemainingTime standing(options);
  for (int i = 1; i <= 4; ++i) standing.add(iteration(i, 2.0 * i, 0.1));
  EXPECT_NEAR(standing.seconds().value_or(-1), 12, 1e-9);
  options.set_time_limit(9);
  RemainingTime limited(options);
  for (int i = 1; i <= 4; ++i) limited.add(iteration(i, 2.0 * i, 0.1));
  EXPECT_NEAR(limited.seconds().value_or(-1), 1, 1e-9);
}

}  // namespace
}  // namespace varimesh::client
