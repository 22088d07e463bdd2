// Which phase comes next, and when a run ends.
#include "core/optimise/phases.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

// === PhaseChooser ========================================================================================

/// Lets `count` iterations pass without fewer uncertified cells.
void stall(PhaseChooser& chooser, std::int64_t unrepaired, int count) {
  for (int i = 0; i < count; ++i) chooser.next(unrepaired, unrepaired, false);
}

TEST(PhaseChooser, UntanglesAfterSweepsAndNewtonHaveStalled) {
  PhaseChooser chooser(Options(), 5);
  EXPECT_EQ(chooser.phase(), Phase::Sweeps);
  stall(chooser, 5, 10);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  EXPECT_EQ(chooser.outlook(5), Outlook::AnotherMethod);
  stall(chooser, 5, 10);
  ASSERT_EQ(chooser.phase(), Phase::Untangle);
  chooser.untangling_from(5);
  stall(chooser, 5, 100);
  EXPECT_EQ(chooser.phase(), Phase::Untangle) << "untangling says itself when it ends";
  chooser.next(5, 5, true);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  EXPECT_EQ(chooser.outlook(5), Outlook::Nothing) << "untangling has repaired no cell";
  stall(chooser, 5, 100);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
}

TEST(PhaseChooser, UntanglesAgainOnlyAfterSuccess) {
  PhaseChooser chooser(Options(), 5);
  stall(chooser, 5, 20);
  chooser.untangling_from(5);
  chooser.next(3, 3, true);
  EXPECT_EQ(chooser.outlook(3), Outlook::AnotherMethod);
  stall(chooser, 3, 10);
  EXPECT_EQ(chooser.phase(), Phase::Untangle);
}

TEST(PhaseChooser, DoesNotUntangleWhatCannotBeRepaired) {
  PhaseChooser chooser(Options(), 5);
  EXPECT_EQ(chooser.outlook(0), Outlook::Nothing);
  chooser.next(0, 0, false);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  stall(chooser, 0, 50);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
}

TEST(PhaseChooser, ComesToTheSamePhasesIfOnlyAValidMeshIsAskedFor) {
  Options options;
  PhaseChooser whole(options, 5);
  options.until = Until::Valid;
  PhaseChooser until_valid(options, 5);
  for (int iteration = 0; iteration < 60; ++iteration) {
    ASSERT_EQ(whole.phase(), until_valid.phase()) << iteration;
    const bool untangles = whole.phase() == Phase::Untangle;
    for (PhaseChooser* chooser : {&whole, &until_valid}) {
      if (untangles && iteration % 4 == 0) chooser->untangling_from(5);
      chooser->next(iteration < 30 ? 5 : 4, 4, untangles && iteration % 4 == 3);
    }
    ASSERT_EQ(whole.outlook(4), until_valid.outlook(4)) << iteration;
  }
}

TEST(PhaseChooser, KeepsToTheMethodAskedFor) {
  Options options;
  options.method = Method::Sweeps;
  PhaseChooser sweeps(options, 5);
  stall(sweeps, 5, 100);
  EXPECT_EQ(sweeps.phase(), Phase::Sweeps);
  EXPECT_EQ(sweeps.outlook(5), Outlook::Nothing);
  options.method = Method::Newton;
  PhaseChooser newton(options, 5);
  stall(newton, 5, 100);
  EXPECT_EQ(newton.phase(), Phase::Newton);
}

TEST(PhaseChooser, BeginsWithNewtonOnAValidMesh) { EXPECT_EQ(PhaseChooser(Options(), 0).phase(), Phase::Newton); }

TEST(PhaseChooser, SweepsOnWhileCellsAreRepaired) {
  PhaseChooser chooser(Options(), 100);
  for (std::int64_t left = 99; left > 0; --left) {
    stall(chooser, left + 1, 8);
    chooser.next(left, left, false);
    ASSERT_EQ(chooser.phase(), Phase::Sweeps) << left;
  }
  chooser.next(0, 0, false);
  EXPECT_EQ(chooser.phase(), Phase::Newton) << "all are repaired";
}

TEST(PhaseChooser, SweepsForAWhileIfNewtonIsStuck) {
  PhaseChooser chooser(Options(), 0);
  for (int time = 0; time < 3; ++time) {
    EXPECT_EQ(chooser.phase(), Phase::Newton);
    EXPECT_TRUE(chooser.next(0, 0, true));
    for (int sweep = 0; sweep < 5; ++sweep) {
      EXPECT_EQ(chooser.phase(), Phase::Sweeps);
      EXPECT_TRUE(chooser.next(0, 0, false));
    }
  }
  EXPECT_FALSE(chooser.next(0, 0, true)) << "the fourth time nothing is left to try";
}

TEST(PhaseChooser, EndsNewtonAloneWhenItIsStuck) {
  Options options;
  options.method = Method::Newton;
  EXPECT_FALSE(PhaseChooser(options, 0).next(0, 0, true));
}

TEST(PhaseChooser, UntanglesThreeTimesAtMost) {
  PhaseChooser chooser(Options(), 100);
  std::int64_t left = 100;
  int times = 0;
  for (int iteration = 0; iteration < 500; ++iteration) {
    if (chooser.phase() != Phase::Untangle) {
      chooser.next(left, left, false);
      continue;
    }
    ++times;
    chooser.untangling_from(left);
    left -= 10;
    chooser.next(left, left, true);
  }
  EXPECT_EQ(times, 3);
}

// === Stopper =============================================================================================

Iteration iteration(int number, std::int64_t invalid, std::int64_t repairable, double seconds = 0) {
  Iteration i;
  i.number = number;
  i.invalid_elements = invalid;
  i.repairable_elements = repairable;
  i.seconds = seconds;
  return i;
}

TEST(Stopper, GoesOnByDefaultUntilItConverges) {
  const Options options;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(0, 0, 0), false, Outlook::Nothing, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(1, 0, 0), false, Outlook::Nothing, 1), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(2, 0, 0), true, Outlook::AnotherMethod, 1), std::nullopt)
      << "another method is to come";
  EXPECT_EQ(stopper.after(iteration(3, 0, 0), true, Outlook::Patience, 1), StopReason::Converged);
}

TEST(Stopper, StopsAtAValidMeshIfThatIsAskedFor) {
  Options options;
  options.until = Until::Valid;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(0, 2, 2), false, Outlook::AnotherMethod, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(1, 0, 0), false, Outlook::AnotherMethod, 0), StopReason::Valid);
  Stopper at_once(options);
  EXPECT_EQ(at_once.after(iteration(0, 0, 0), false, Outlook::Nothing, 0), StopReason::Valid) << "before it begins";
}

TEST(Stopper, StopsIfOnlyUnrepairableCellsAreLeft) {
  Options options;
  options.until = Until::Valid;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(1, 3, 0), false, Outlook::AnotherMethod, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(2, 3, 0), false, Outlook::Nothing, 0), StopReason::Repaired);
}

TEST(Stopper, OfTheAccuracyObjectiveStopsWhereARunUntilValidDoes) {
  Options options;
  options.objective = Objective::Accuracy;
  Stopper valid(options), unrepairable(options), stalled(options);
  Iteration low = iteration(1, 0, 0), high = iteration(2, 0, 0);
  low.min_scaled_jacobian = 0.99 * options.min_js;
  high.min_scaled_jacobian = options.min_js;
  EXPECT_EQ(valid.after(low, false, Outlook::Nothing, 0), std::nullopt);
  EXPECT_FALSE(valid.asks_for_proof(low));
  EXPECT_TRUE(valid.asks_for_proof(high));
  EXPECT_FALSE(valid.asks_for_proof(iteration(2, 1, 1)));
  // The quadrature points see less than the proof.
  EXPECT_EQ(valid.after(high, false, Outlook::Nothing, 0.99 * options.min_js), std::nullopt);
  EXPECT_EQ(valid.after(high, false, Outlook::Nothing, options.min_js), StopReason::Valid);
  Stopper came_valid(options), came_low(options);
  low.number = high.number = 0;
  EXPECT_EQ(came_low.after(low, false, Outlook::Nothing, 0), std::nullopt) << "the energy comes first";
  EXPECT_EQ(came_valid.after(high, false, Outlook::Nothing, options.min_js), StopReason::Valid);
  for (int number = 1; number <= 30; ++number)
    EXPECT_EQ(came_low.after(iteration(number, 5, 5), false, Outlook::Nothing, 0), std::nullopt) << "lost certificates";
  EXPECT_EQ(unrepairable.after(iteration(1, 3, 0), false, Outlook::Nothing, 0), StopReason::Repaired);
  int number = 0;
  for (; number < 50; ++number)
    EXPECT_EQ(stalled.after(iteration(number, 5, 5), false, Outlook::Patience, 0), std::nullopt);
  EXPECT_EQ(stalled.after(iteration(++number, 5, 5), false, Outlook::Nothing, 0), StopReason::NoProgress);
}

TEST(Stopper, SaysOnceThatARunUntilValidWouldEndWithoutAValidMesh) {
  Options options;
  Stopper stopper(options);
  int times = 0;
  for (int number = 0; number <= 30; ++number) {
    EXPECT_EQ(stopper.after(iteration(number, 5, 5), false, Outlook::Nothing, 0), std::nullopt);
    times += stopper.has_just_given_up() ? 1 : 0;
    EXPECT_EQ(times, number < 10 ? 0 : 1) << number;
  }
}

TEST(Stopper, StopsAfterTenIterationsWithoutFewerUncertifiedCells) {
  Options options;
  options.until = Until::Valid;
  Stopper stopper(options);
  int number = 0;
  EXPECT_EQ(stopper.after(iteration(number, 5, 5), false, Outlook::Nothing, 0), std::nullopt);
  for (int i = 0; i < 9; ++i)
    EXPECT_EQ(stopper.after(iteration(++number, 5, 5), false, Outlook::Nothing, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(++number, 4, 4), false, Outlook::Nothing, 0), std::nullopt) << "one fewer";
  for (int i = 0; i < 9; ++i)
    EXPECT_EQ(stopper.after(iteration(++number, 6, 6), false, Outlook::Nothing, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(++number, 4, 4), false, Outlook::Patience, 0), std::nullopt)
      << "there is hope still";
  EXPECT_EQ(stopper.after(iteration(++number, 4, 4), false, Outlook::Nothing, 0), StopReason::NoProgress);
}

TEST(Stopper, StopsAtTheProvedScaledJacobianAskedFor) {
  Options options;
  options.until_js = 0.5;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(1, 0, 0), false, Outlook::Nothing, 0.499), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(2, 0, 0), false, Outlook::Nothing, 0.5), StopReason::Quality);
}

TEST(Stopper, StopsAtItsLimits) {
  Options options;
  options.max_iterations = 7;
  options.time_limit = 10;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(6, 0, 0, 9.9), false, Outlook::Nothing, 0), std::nullopt);
  EXPECT_EQ(stopper.after(iteration(6, 0, 0, 10), false, Outlook::Nothing, 0), StopReason::TimeLimit);
  EXPECT_EQ(stopper.after(iteration(7, 0, 0, 1), false, Outlook::Nothing, 0), StopReason::Iterations);
  EXPECT_EQ(stopper.after(iteration(7, 0, 0, 10), true, Outlook::Nothing, 0), StopReason::Converged)
      << "convergence counts before limits";
}

TEST(Stopper, ChecksOnlyIfNoIterationIsAllowed) {
  Options options;
  options.max_iterations = 0;
  Stopper stopper(options);
  EXPECT_EQ(stopper.after(iteration(0, 2, 2), false, Outlook::AnotherMethod, 0), StopReason::Iterations);
}

}  // namespace
}  // namespace varimesh
