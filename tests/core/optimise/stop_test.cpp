// Runs that are stopped at random moments, in every phase, end at once with a mesh that is whole and certified.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <random>
#include <thread>

#include "core/optimise/optimiser.h"
#include "tests/core/optimise/stopped_runs.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::RunToStop;

/// The runs are stopped at other moments if VARIMESH_SEED is set.
unsigned seed() {
  const char* text = std::getenv("VARIMESH_SEED");
  return text == nullptr ? 19 : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
}

/// Says yes from the n-th question on, and counts the questions.
struct StopAt {
  std::int64_t look = 0;
  std::atomic<std::int64_t> asked = 0;

  Result run(const RunToStop& run, RunControl control = {}) {
    control.stop_asked = [this] { return ++asked >= look; };
    auto result = optimise(run.mesh, run.options, {}, control);
    EXPECT_TRUE(result) << result.error().sentence;
    return std::move(*result);
  }
};

std::int64_t looks_of(const RunToStop& run) {
  StopAt never{std::numeric_limits<std::int64_t>::max()};
  const Result result = never.run(run);
  EXPECT_FALSE(result.stopped);
  testing::expect_sound(run, result);
  return never.asked;
}

void stop_at_random_looks(const RunToStop& run, int times) {
  const std::int64_t looks = looks_of(run);
  ASSERT_GT(looks, 10) << run.name;
  std::mt19937 random(seed());
  for (int i = 0; i < times; ++i) {
    StopAt stop{std::uniform_int_distribution<std::int64_t>(1, looks)(random)};
    SCOPED_TRACE(run.name + ", stopped at look " + std::to_string(stop.look) + " of " + std::to_string(looks));
    const Result result = stop.run(run);
    testing::expect_sound(run, result);
    // Every thread may ask once more before it learns of the answer.
    EXPECT_LE(stop.asked, stop.look + run.options.threads);
    EXPECT_EQ(result.stopped, result.stop_reason == StopReason::Stopped);
  }
}

class RunOfEveryPhase : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Phases, RunOfEveryPhase,
                         ::testing::Range(0, static_cast<int>(testing::runs_of_all_phases().size())),
                         [](const auto& info) {
                           return testing::runs_of_all_phases()[static_cast<std::size_t>(info.param)].name;
                         });

TEST_P(RunOfEveryPhase, EndsWhenItIsStopped) {
  stop_at_random_looks(testing::runs_of_all_phases()[static_cast<std::size_t>(GetParam())], 16);
}

/// Once an interrupted raise has moved cells, the loss is compared without another look.
TEST(RaisedCells, AreKeptWhenTheRunIsStopped) {
  const auto runs = testing::runs_of_all_phases();
  const RunToStop& run = *std::ranges::find(runs, "raising_a_valid_mesh", &RunToStop::name);
  const std::int64_t looks = looks_of(run);
  int raised = 0;
  for (std::int64_t last = looks - 60; last <= looks; last += 4) {
    StopAt stop{last};
    SCOPED_TRACE(std::to_string(last) + " of " + std::to_string(looks));
    const Result result = stop.run(run);
    testing::expect_sound(run, result);
    for (const std::string& note : result.notes)
      raised += note.find("was raised in small patches") != std::string::npos;
  }
  EXPECT_GT(raised, 8);
}

TEST_P(RunOfEveryPhase, GoesOnToTheSameBitsIfItIsNotStopped) {
  const RunToStop run = testing::runs_of_all_phases()[static_cast<std::size_t>(GetParam())];
  StopAt never{std::numeric_limits<std::int64_t>::max()};
  EXPECT_EQ(never.run(run).mesh.coordinates, optimise(run.mesh, run.options)->mesh.coordinates);
}

TEST_P(RunOfEveryPhase, IsCancelledFromAnotherThread) {
  const RunToStop run = testing::runs_of_all_phases()[static_cast<std::size_t>(GetParam())];
  std::mt19937 random(seed());
  for (int i = 0; i < 4; ++i) {
    const std::chrono::microseconds wait(std::uniform_int_distribution<int>(0, 20'000)(random));
    SCOPED_TRACE(run.name + ", cancelled after " + std::to_string(wait.count()) + " microseconds");
    std::atomic<bool> cancelled = false;
    RunControl control;
    control.stop_asked = [&] { return cancelled.load(std::memory_order_relaxed); };
    std::jthread canceller([&] {
      std::this_thread::sleep_for(wait);
      cancelled = true;
    });
    const auto result = optimise(run.mesh, run.options, {}, control);
    ASSERT_TRUE(result) << result.error().sentence;
    testing::expect_sound(run, *result);
  }
}

TEST_P(RunOfEveryPhase, EndsAtItsTimeLimit) {
  RunToStop run = testing::runs_of_all_phases()[static_cast<std::size_t>(GetParam())];
  std::mt19937 random(seed());
  for (int i = 0; i < 4; ++i) {
    run.options.time_limit = i == 0 ? 1e-9 : std::uniform_real_distribution<double>(0, 0.02)(random);
    SCOPED_TRACE(run.name + ", time limit " + std::to_string(run.options.time_limit));
    const auto result = optimise(run.mesh, run.options);
    ASSERT_TRUE(result) << result.error().sentence;
    testing::expect_sound(run, *result);
    EXPECT_FALSE(result->stopped);
    if (i > 0) continue;
    EXPECT_EQ(result->stop_reason, StopReason::TimeLimit);
    EXPECT_EQ(result->iterations, 0);
    EXPECT_EQ(result->before.uncertified.size(), result->after.uncertified.size());
  }
}

class RunOfOrder : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Orders, RunOfOrder, ::testing::Range(1, 11));

TEST_P(RunOfOrder, EndsWhenItIsStopped) {
  for (const Filling filling : {Filling::MixedPlane, Filling::MixedSolid}) {
    if (filling == Filling::MixedSolid && GetParam() > 4) continue;  // stop_times has the others
    stop_at_random_looks(testing::run_to_stop("order " + std::to_string(GetParam()),
                                              testing::pushed(filling, {3, 2, 1}, GetParam(), 0.1 / GetParam()),
                                              [](Options& o) { o.max_iterations = 20; }),
                         6);
  }
}

TEST(StoppedRun, KeepsWhatItsIterationsHaveReached) {
  const RunToStop run = testing::run_to_stop("newton", testing::pushed(Filling::Hexahedra, {3, 3, 2}, 3, 0.02),
                                             [](Options& o) { o.method = Method::Newton; });
  // The mesh after the first iteration.
  Options one = run.options;
  one.max_iterations = 1;
  const auto first = optimise(run.mesh, one);
  ASSERT_TRUE(first);
  std::atomic<bool> stop = false;
  RunControl control;
  std::int64_t looks = 0;
  control.stop_asked = [&] { return stop && ++looks > 20; };  // in the middle of the second iteration
  const auto result = optimise(
      run.mesh, run.options,
      [&](const Iteration&) {
        stop = true;
        return Control::Continue;
      },
      control);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->iterations, 1);
  EXPECT_TRUE(result->stopped);
  EXPECT_EQ(result->stop_reason, StopReason::Stopped);
  EXPECT_EQ(result->mesh.coordinates, first->mesh.coordinates);
  EXPECT_FALSE(result->converged);
}

TEST(StoppedRun, GoesOnFromACheckpointThatItHasTaken) {
  const RunToStop run = testing::run_to_stop("tangled", testing::pushed(Filling::Tetrahedra, {3, 2, 2}, 3, 0.12),
                                             [](Options& o) { o.max_iterations = 40; });
  const auto whole = optimise(run.mesh, run.options);
  ASSERT_TRUE(whole);
  ASSERT_GT(whole->iterations, 4);
  std::string saved;
  std::int64_t looks = 0;
  RunControl control;
  control.stop_asked = [&] { return !saved.empty() && ++looks > 300; };
  control.checkpoint_due = [&](const Iteration& i) { return i.number >= 2 && saved.empty(); };
  control.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) {
    write([&](std::string_view bytes) {
      saved += bytes;
      return true;
    });
  };
  const auto stopped = optimise(run.mesh, run.options, {}, control);
  ASSERT_TRUE(stopped);
  ASSERT_TRUE(stopped->stopped);
  testing::expect_sound(run, *stopped);
  RunControl again;
  again.checkpoint = saved;
  const auto resumed = optimise(run.mesh, run.options, {}, again);
  ASSERT_TRUE(resumed);
  EXPECT_GT(resumed->resumed_from, 0);
  EXPECT_EQ(resumed->mesh.coordinates, whole->mesh.coordinates);

  // A stop that comes before the state is restored waits until it is.
  again.stop_asked = [] { return true; };
  const auto at_once = optimise(run.mesh, run.options, {}, again);
  ASSERT_TRUE(at_once);
  EXPECT_TRUE(at_once->stopped);
  EXPECT_EQ(at_once->resumed_from, resumed->resumed_from);
  EXPECT_EQ(at_once->iterations, resumed->resumed_from);
  testing::expect_sound(run, *at_once);
}

}  // namespace
}  // namespace varimesh
