// A run that several ranks make together has the result of a run alone.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/ranks/thread_ranks.h"
#include "tests/core/optimise/run_on_a_grid.h"
#include "tests/core/optimise/stopped_runs.h"

namespace varimesh {
namespace {

using testing::Filling;

using SharedCase = testing::RunOnAGrid;

class RunOfRanks : public ::testing::TestWithParam<SharedCase> {
 protected:
  static Options options() { return GetParam().options(); }
  static HighOrderMesh mesh() { return GetParam().mesh(); }
};

SharedCase accurate(const char* name, Filling filling, std::array<int, 3> counts, int order, double shake = 0.003,
                    bool has_two_parts = true) {
  return {name, filling, counts, order, shake, Objective::Accuracy, has_two_parts};
}

INSTANTIATE_TEST_SUITE_P(Meshes, RunOfRanks,
                         ::testing::Values(SharedCase{"Triangles", Filling::Triangles, {24, 24, 0}, 3, 0.0005},
                                           SharedCase{"MixedSolid", Filling::MixedSolid, {6, 6, 6}, 2, 0.003},
                                           SharedCase{"Tangled", Filling::Tetrahedra, {5, 5, 5}, 2, 0.3},
                                           accurate("LossTriangles4", Filling::Triangles, {20, 20, 0}, 4, 0.0003),
                                           accurate("LossQuadrilaterals3", Filling::Quadrilaterals, {24, 24, 0}, 3,
                                                    0.0005),
                                           accurate("LossMixedPlane2", Filling::MixedPlane, {21, 30, 0}, 2),
                                           accurate("LossHexahedra2", Filling::Hexahedra, {10, 10, 10}, 2),
                                           accurate("LossPrisms3", Filling::Prisms, {7, 7, 7}, 3),
                                           accurate("LossPyramids2", Filling::Pyramids, {5, 5, 5}, 2),
                                           accurate("LossTetrahedra4", Filling::Tetrahedra, {4, 4, 4}, 4, 0.0005),
                                           accurate("LossMixedSolid2", Filling::MixedSolid, {6, 6, 6}, 2),
                                           accurate("LossOfFewCells", Filling::MixedSolid, {2, 1, 1}, 3, 0.003, false),
                                           accurate("LossTangled", Filling::Tetrahedra, {4, 4, 4}, 2, 0.3)),
                         [](const auto& info) { return std::string(info.param.name); });

TEST_P(RunOfRanks, HasTheResultOfARunAlone) {
  const auto alone = optimise(mesh(), options());
  ASSERT_TRUE(alone) << alone.error().sentence;
  EXPECT_EQ(alone->before.uncertified.empty(), GetParam().shake < 0.1);
  ASSERT_GT(alone->history.size(), 1U);
  for (const int count : GetParam().shake < 0.1 ? std::vector{1, 2, 3, 5} : std::vector{1, 3})
    run_as_ranks(count, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      const Traffic before = ranks.traffic();
      const auto together = optimise(mesh(), options(), {}, control);
      ASSERT_TRUE(together) << together.error().sentence;
      EXPECT_EQ(ranks.traffic().meetings > before.meetings, count > 1);
      if (count == 2 && GetParam().has_two_parts) {
        EXPECT_GT(ranks.traffic().messages, before.messages) << "each has a part, and exchanges its halo";
      }
      const std::vector<double>&mine = together->mesh.coordinates, &all = alone->mesh.coordinates;
      ASSERT_EQ(mine.size(), all.size());
      EXPECT_EQ(std::memcmp(mine.data(), all.data(), 8 * all.size()), 0);
      ASSERT_EQ(together->history.size(), alone->history.size());
      for (std::size_t i = 0; i < alone->history.size(); ++i) {
        EXPECT_EQ(together->history[i].energy, alone->history[i].energy);
        EXPECT_EQ(together->history[i].residual, alone->history[i].residual);
        EXPECT_EQ(together->history[i].products, alone->history[i].products);
        EXPECT_EQ(together->history[i].min_scaled_jacobian, alone->history[i].min_scaled_jacobian);
        EXPECT_EQ(together->history[i].phase, alone->history[i].phase);
      }
      EXPECT_EQ(together->stop_reason, alone->stop_reason);
      EXPECT_EQ(together->after.min_scaled_jacobian, alone->after.min_scaled_jacobian);
      EXPECT_EQ(together->after.mean_scaled_jacobian, alone->after.mean_scaled_jacobian);
      ASSERT_TRUE(together->after.accuracy && alone->after.accuracy);
      EXPECT_EQ(together->after.accuracy->loss, alone->after.accuracy->loss);
      EXPECT_EQ(together->notes, alone->notes);
    });
}

/// What each of several ranks makes of a run.
std::vector<Result> together(int count, const std::function<Expected<Result>(const Ranks&)>& run) {
  std::vector<Result> results(static_cast<std::size_t>(count));
  run_as_ranks(count, [&](const Ranks& ranks) {
    auto mine = run(ranks);
    ASSERT_TRUE(mine) << mine.error().sentence;
    results[static_cast<std::size_t>(ranks.rank())] = std::move(*mine);
  });
  return results;
}

void expect_one_end(const std::vector<Result>& results) {
  for (const Result& mine : results) {
    EXPECT_EQ(mine.mesh.coordinates, results.front().mesh.coordinates);
    EXPECT_EQ(mine.stop_reason, results.front().stop_reason);
    EXPECT_EQ(mine.stopped, results.front().stopped);
    EXPECT_EQ(mine.iterations, results.front().iterations);
    EXPECT_EQ(mine.after.min_scaled_jacobian, results.front().after.min_scaled_jacobian);
    EXPECT_EQ(mine.after.lattice_intervals, results.front().after.lattice_intervals);
  }
}

/// The run of which the last of three ranks is asked to end it, at its n-th look; and how often it has looked.
std::vector<Result> stopped_at(std::int64_t look, const testing::RunToStop& run, std::int64_t* looks = nullptr) {
  std::int64_t asked = 0;
  std::vector<Result> results = together(3, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    control.stop_asked = [&] { return ranks.rank() == 2 && ++asked >= look; };
    return optimise(run.mesh, run.options, {}, control);
  });
  if (looks != nullptr) *looks = asked;
  return results;
}

TEST_P(RunOfRanks, EndsOnAllWhenOneIsAsked) {
  const testing::RunToStop run{GetParam().name, mesh(), options()};
  std::int64_t looks = 0;
  const std::vector<Result> whole = stopped_at(std::numeric_limits<std::int64_t>::max(), run, &looks);
  ASSERT_GT(looks, 10);
  EXPECT_FALSE(whole.front().stopped);
  std::mt19937 random(19);
  for (int i = 0; i < 4; ++i) {
    const std::int64_t look = i == 0 ? 1 : std::uniform_int_distribution<std::int64_t>(1, looks)(random);
    SCOPED_TRACE("at look " + std::to_string(look) + " of " + std::to_string(looks));
    const std::vector<Result> results = stopped_at(look, run);
    expect_one_end(results);
    const Result& result = results.front();
    EXPECT_EQ(result.stopped, result.stop_reason == StopReason::Stopped);
    testing::expect_sound(run, result);
    if (i == 0) {
      EXPECT_TRUE(result.stopped);
      EXPECT_EQ(result.iterations, 0);
    }
    // Newton's method leaves what the iterations before have left, or the step of the one that was under way.
    const bool has_steps_only = run.options.objective == Objective::Energy && GetParam().shake < 0.1;
    if (!result.stopped || result.iterations == 0 || !has_steps_only) continue;
    Options as_many = run.options;
    as_many.max_iterations = result.iterations;
    if (result.mesh.coordinates == optimise(run.mesh, as_many)->mesh.coordinates) continue;
    ++as_many.max_iterations;
    EXPECT_TRUE(result.mesh.coordinates == optimise(run.mesh, as_many)->mesh.coordinates)
        << result.iterations << " iterations; " << result.kept_as_it_came << " lattice "
        << result.after.lattice_intervals << " as it came " << (result.mesh.coordinates == run.mesh.coordinates);
  }
}

TEST_P(RunOfRanks, EndsOnAllAfterAnIterationThatOneEnds) {
  const auto ends = [](bool mine, const Iteration& iteration) {
    return mine && iteration.number == 2 ? Control::Stop : Control::Continue;
  };
  const auto alone = optimise(mesh(), options(), [&](const Iteration& i) { return ends(true, i); });
  const std::vector<Result> results = together(3, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    return optimise(
        mesh(), options(), [&](const Iteration& i) { return ends(ranks.rank() == 1, i); }, control);
  });
  expect_one_end(results);
  EXPECT_EQ(results.front().iterations, 2);
  EXPECT_EQ(results.front().stop_reason, alone->stop_reason);
  EXPECT_EQ(results.front().mesh.coordinates, alone->mesh.coordinates);
  EXPECT_EQ(results.front().notes, alone->notes);
}

TEST_P(RunOfRanks, EndsOnAllAtATimeLimit) {
  testing::RunToStop run{GetParam().name, mesh(), options()};
  std::mt19937 random(19);
  for (int i = 0; i < 3; ++i) {
    const double limit = i == 0 ? 1e-9 : std::uniform_real_distribution<double>(0, 0.1)(random);
    SCOPED_TRACE(limit);
    const std::vector<Result> results = together(3, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      // Reading has taken another time on each.
      Options limited = run.options;
      limited.time_limit = limit * (1 + ranks.rank());
      return optimise(run.mesh, limited, {}, control);
    });
    expect_one_end(results);
    EXPECT_FALSE(results.front().stopped);
    testing::expect_sound(run, results.front());
    if (i > 0) continue;
    EXPECT_EQ(results.front().stop_reason, StopReason::TimeLimit);
    EXPECT_EQ(results.front().iterations, 0);
  }
}

TEST(RanksThatShareARun, SplitNoElements) {
  run_as_ranks(2, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    Options options;
    options.repair = Repair::Split;
    const auto refused = optimise(testing::grid(Filling::Triangles, {3, 3, 0}, 2), options, {}, control);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, Error::Kind::BadOption);
  });
}

}  // namespace
}  // namespace varimesh
