// Which ways to slide are tried, and what is taken.
#include "core/optimise/on_geometry/optimise_on_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/merit/merit.h"
#include "core/optimise/memory.h"
#include "tests/core/optimise/on_geometry/disc_on_cylinder.h"
#include "tests/core/support/cases.h"

namespace varimesh {
namespace {

using testing::cylinder;
using testing::disc;
using testing::DiscMesh;
using testing::left;
using testing::on_cylinder;
using testing::read_case;
using Outcome = SlideTrial::Outcome;

/// One way to slide, and the optimisation, one after the other.
Result slid_and_optimised(SlideOn slide) {
  HighOrderMesh mesh = disc();
  GeometryOptions geometry;
  geometry.slide = slide;
  EXPECT_TRUE(slide_on_model(mesh, geometry, cylinder()));
  return optimise(std::move(mesh)).value();
}

TEST(OptimiseOnGeometry, MovesAllNodesTogetherIfElementsAreLeft) {
  std::vector<SlideTrial> told;
  OnGeometryHooks hooks;
  hooks.on_trial = [&](const SlideTrial& trial) { told.push_back(trial); };
  const ResultOnGeometry done = on_cylinder(SlideOn::Auto, {}, {}, hooks);
  ASSERT_EQ(done.trials.size(), 1u);
  EXPECT_EQ(done.trials[0].slide, SlideOn::Coupled);
  EXPECT_EQ(done.trials[0].outcome, Outcome::Taken);
  EXPECT_GT(done.trials[0].left_before, 0);
  EXPECT_EQ(done.trials[0].left, 0);
  EXPECT_EQ(left(done.result), 0);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0].outcome, Outcome::Running);
  EXPECT_EQ(told[0].left_before, done.trials[0].left_before);
  EXPECT_EQ(told[1].outcome, Outcome::Taken);
  EXPECT_EQ(done.result.mesh.coordinates, slid_and_optimised(SlideOn::Coupled).mesh.coordinates);
}

TEST(OptimiseOnGeometry, ComparesWithAMeshThatDidNotSlide) {
  // Whoever names a way gets it, and not another. But the mesh as it came may be better.
  const ResultOnGeometry done = on_cylinder(SlideOn::All);
  ASSERT_EQ(done.trials.size(), 1u);
  EXPECT_EQ(done.trials[0].slide, SlideOn::None);
  const Result slid = slid_and_optimised(SlideOn::All), still = slid_and_optimised(SlideOn::None);
  EXPECT_EQ(done.trials[0].left_before, left(slid));
  EXPECT_EQ(done.trials[0].left, left(still));
  const bool is_better = left(still) < left(slid);
  EXPECT_EQ(done.trials[0].outcome, is_better ? Outcome::Taken : Outcome::NoBetter);
  EXPECT_EQ(done.result.mesh.coordinates, (is_better ? still : slid).mesh.coordinates);
}

TEST(OptimiseOnGeometry, CountsTheSecondsOfAllRuns) {
  double last = 0;
  const ResultOnGeometry done = on_cylinder(SlideOn::All, {}, {}, {}, [&](const Iteration& iteration) {
    last = std::max(last, iteration.seconds);
    return Control::Continue;
  });
  ASSERT_EQ(done.trials.size(), 1u);
  EXPECT_GE(done.result.seconds, last);
}

TEST(OptimiseOnGeometry, TriesNothingElseIfNothingIsToSlide) {
  const ResultOnGeometry done = on_cylinder(SlideOn::None);
  EXPECT_GT(left(done.result), 0);
  EXPECT_TRUE(done.trials.empty());
  ASSERT_TRUE(done.slid);
  EXPECT_EQ(done.slid->slid.report.nodes, 0);
}

TEST(OptimiseOnGeometry, SaysWhatTheGeometryCameToOnce) {
  std::vector<std::string> sentences;
  OnGeometryHooks hooks;
  hooks.on_sentence = [&](const std::string& sentence) { sentences.push_back(sentence); };
  on_cylinder(SlideOn::Auto, {}, {}, hooks);
  ASSERT_FALSE(sentences.empty());
  std::ranges::sort(sentences);
  EXPECT_EQ(std::ranges::adjacent_find(sentences), sentences.end());
}

TEST(OptimiseOnGeometry, TakesTheBetterOfTheSlidAndTheOwnBoundary) {
  for (const char* name : {"geometry/bracket_p3.msh", "cylinder_p2.msh"}) {
    const HighOrderMesh mesh = read_case(name);
    GeometryOptions geometry;
    geometry.slide_on = GeometrySource::Boundary;
    const auto done = optimise_on_geometry(mesh, {}, geometry);
    ASSERT_TRUE(done) << done.error().sentence;
    ASSERT_EQ(done->trials.size(), 1u);
    EXPECT_EQ(done->trials[0].slide, SlideOn::None);
    HighOrderMesh slid = mesh;
    ASSERT_TRUE(slide_on_boundary(slid, geometry));
    const Result with = optimise(std::move(slid)).value(), without = optimise(mesh).value();
    const bool is_better = left(without) != left(with)
                               ? left(without) < left(with)
                               : without.after.min_scaled_jacobian > with.after.min_scaled_jacobian;
    EXPECT_EQ(done->trials[0].outcome, is_better ? Outcome::Taken : Outcome::NoBetter) << name;
    EXPECT_EQ(done->result.mesh.coordinates, (is_better ? without : with).mesh.coordinates) << name;
    EXPECT_EQ(done->slid.has_value(), !is_better) << name;
  }
}

TEST(OptimiseOnGeometry, HasTheSameBitsForAnyNumberOfThreads) {
  Options one, three;
  one.threads = 1;
  three.threads = 3;
  EXPECT_EQ(on_cylinder(SlideOn::Auto, one).result.mesh.coordinates,
            on_cylinder(SlideOn::Auto, three).result.mesh.coordinates);
}

TEST(OptimiseOnGeometry, KeepsTheBestMeshIfItIsStoppedInATrial) {
  bool stops = false;
  RunControl control;
  control.stop_asked = [&] { return stops; };
  OnGeometryHooks hooks;
  hooks.on_trial = [&](const SlideTrial& trial) { stops = stops || trial.outcome == Outcome::Running; };
  const ResultOnGeometry done = on_cylinder(SlideOn::Auto, {}, control, hooks);
  ASSERT_EQ(done.trials.size(), 1u);
  EXPECT_EQ(done.trials[0].outcome, Outcome::Stopped);
  EXPECT_TRUE(done.result.stopped);
  EXPECT_EQ(done.result.mesh.coordinates, slid_and_optimised(SlideOn::All).mesh.coordinates);
}

TEST(OptimiseOnGeometry, EndsWithTheMeshAsItCameIfTheTimePassesWhileNodesSlide) {
  Options options;
  options.time_limit = 1e-6;
  std::string told;
  OnGeometryHooks hooks;
  hooks.on_sentence = [&](const std::string& sentence) { told += sentence; };
  const ResultOnGeometry done = on_cylinder(SlideOn::Auto, options, {}, hooks);
  EXPECT_NE(told.find("The time limit passed while boundary nodes slid"), std::string::npos) << told;
  EXPECT_FALSE(done.slid);
  EXPECT_TRUE(done.trials.empty());
  EXPECT_EQ(done.result.mesh.coordinates, disc().coordinates);
}

TEST(OptimiseOnGeometry, SaysThatATrialWasCutShort) {
  // The time passes as soon as the second way to slide begins.
  Options options;
  options.time_limit = 2;
  OnGeometryHooks hooks;
  hooks.on_trial = [&](const SlideTrial& trial) {
    if (trial.outcome == Outcome::Running) std::this_thread::sleep_for(std::chrono::duration<double>(2.01));
  };
  const ResultOnGeometry done = on_cylinder(SlideOn::Auto, options, {}, hooks);
  ASSERT_EQ(done.trials.size(), 1u);
  EXPECT_EQ(done.trials[0].slide, SlideOn::Coupled);
  EXPECT_EQ(done.trials[0].outcome, Outcome::Failed);
  EXPECT_NE(done.trials[0].error.find("time limit"), std::string::npos);
  ASSERT_TRUE(done.slid);
  EXPECT_GT(done.slid->slid.report.nodes, 0);
}

/// How many rounds lower the loss of accuracy before a second way to slide begins.
int rounds_before_trial(double time_limit) {
  Options options;
  options.time_limit = time_limit;
  int rounds = 0;
  bool has_trial = false;
  OnGeometryHooks hooks;
  hooks.on_trial = [&](const SlideTrial&) { has_trial = true; };
  on_cylinder(SlideOn::Auto, options, {}, hooks, [&](const Iteration& iteration) {
    if (!has_trial && iteration.phase == Phase::Accuracy) ++rounds;
    return Control::Continue;
  });
  EXPECT_TRUE(has_trial);
  return rounds;
}

TEST(OptimiseOnGeometry, LowersNoLossBesideElementsThatAnotherRunMayMendIfTimeIsShort) {
  EXPECT_GT(rounds_before_trial(0), 0);
  EXPECT_EQ(rounds_before_trial(100), 0);
}

TEST(OptimiseOnGeometry, LowersTheLossOfTheBestMeshAtLastIfElementsStay) {
  Options limited;
  limited.time_limit = 100;
  const Result in_time = on_cylinder(SlideOn::All, limited).result, whole = on_cylinder(SlideOn::All).result;
  ASSERT_GT(left(whole), 0);
  EXPECT_EQ(left(in_time), left(whole));
  EXPECT_LT(merit_of(in_time.after).loss, 1.05 * merit_of(whole.after).loss);
}

TEST(OptimiseOnGeometry, GivesTheBestMeshTheTimeThatNoOtherRunNeeds) {
  // A valid mesh whose share is over while its loss is lowered.
  Options options;
  options.time_limit = 8;
  bool is_over = false;
  int later = 0;  // iterations of the last run
  const auto wait = [&](const Iteration& iteration) {
    later += is_over ? 1 : 0;
    const bool is_valid = iteration.phase == Phase::Accuracy && iteration.left_elements == 0;
    if (is_valid && !std::exchange(is_over, true))
      std::this_thread::sleep_for(std::chrono::duration<double>(0.76 * options.time_limit - iteration.seconds + 0.1));
    return Control::Continue;
  };
  const Result done = on_cylinder(SlideOn::Coupled, options, {}, {}, wait).result;
  EXPECT_TRUE(is_over);
  EXPECT_GT(later, 0);
  if (done.stop_reason == StopReason::TimeLimit) GTEST_SKIP() << "the machine was too busy to compare the loss";
  const double loss = merit_of(on_cylinder(SlideOn::Coupled).result.after).loss;
  EXPECT_LT(merit_of(done.after).loss, 1.05 * loss);
}

TEST(OptimiseOnGeometry, SaysThatTimeWasShortIfTheLossWasLeftToALaterRun) {
  Options options;
  options.time_limit = 6;
  OnGeometryHooks hooks;
  hooks.on_trial = [&, watch = Stopwatch()](const SlideTrial& trial) {
    if (trial.outcome != Outcome::Running)
      std::this_thread::sleep_for(std::chrono::duration<double>(1.05 * options.time_limit - watch.seconds()));
  };
  const Result done = on_cylinder(SlideOn::All, options, {}, hooks).result;
  ASSERT_GT(left(done), 0);
  EXPECT_EQ(done.stop_reason, StopReason::TimeLimit);
  EXPECT_FALSE(done.converged);
}

TEST(OptimiseOnGeometry, TriesNothingElseIfACurvedMeshHadNoTimeToSlide) {
  Options options;
  options.time_limit = 1e-6;
  GeometryOptions geometry;
  geometry.order = 3;
  const auto done = optimise_on_geometry(DiscMesh(2, 1).mesh(), options, geometry, &cylinder());
  ASSERT_TRUE(done) << done.error().sentence;
  ASSERT_TRUE(done->slid);
  EXPECT_TRUE(done->slid->slid.is_cut_short);
  EXPECT_GT(left(done->result), 0);
  EXPECT_TRUE(done->trials.empty());
  for (const std::string& sentence : done->slid->slid.sentences)
    EXPECT_EQ(sentence.find("boundary nodes slid"), std::string::npos) << sentence;
}

TEST(OptimiseOnGeometry, DoesNotSayThatNothingWasMovedAfterNodesHaveSlid) {
  // Straight sides are at their optimum once the node in the middle of the top, on which faces fold over, is back.
  GeometryOptions geometry;
  geometry.slide = SlideOn::All;
  HighOrderMesh mesh = DiscMesh(2, 1).mesh();
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* x = &mesh.coordinates[3 * node];
    if (x[2] == 1 && std::hypot(x[0], x[1]) < 0.01) x[0] += 1.2;
  }
  const auto done = optimise_on_geometry(mesh, {}, geometry, &cylinder());
  ASSERT_TRUE(done) << done.error().sentence;
  ASSERT_TRUE(done->slid);
  ASSERT_GT(done->slid->slid.report.nodes, 0);
  std::string notes;
  for (const std::string& note : done->result.notes) notes += note;
  EXPECT_NE(notes.find("nothing was moved after nodes had slid"), std::string::npos) << notes;
}

/// A checkpoint of a run, and the iteration after which it was made.
struct Saved {
  int iteration = 0;
  std::string bytes;
};

/// Keeps all checkpoints of a run.
RunControl saving(std::vector<Saved>& saved) {
  RunControl control;
  control.checkpoint_due = [](const Iteration&) { return true; };
  control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
    Saved one{iteration.number, {}};
    write([&](std::string_view bytes) {
      one.bytes += bytes;
      return true;
    });
    saved.push_back(std::move(one));
  };
  return control;
}

TEST(OptimiseOnGeometry, GoesOnFromACheckpointOfAnyRunToTheSameBits) {
  std::vector<Saved> saved;
  int of_first_run = 0, last = 0;
  OnGeometryHooks hooks;
  hooks.on_trial = [&](const SlideTrial& trial) {
    if (trial.outcome == Outcome::Running) of_first_run = last;
  };
  const auto count = [&](const Iteration& iteration) {
    EXPECT_EQ(iteration.number, last + 1);
    last = iteration.number;
    return Control::Continue;
  };
  const ResultOnGeometry whole = on_cylinder(SlideOn::Auto, {}, saving(saved), hooks, count);
  ASSERT_FALSE(saved.empty());
  ASSERT_LE(saved.front().iteration, of_first_run);
  ASSERT_GT(saved.back().iteration, of_first_run);
  for (const std::size_t at : {std::size_t{0}, saved.size() / 2, saved.size() - 1}) {
    std::vector<Saved> later;
    RunControl control = saving(later);
    control.checkpoint = saved[at].bytes;
    const ResultOnGeometry resumed = on_cylinder(SlideOn::Auto, {}, control);
    EXPECT_EQ(resumed.result.mesh.coordinates, whole.result.mesh.coordinates) << at;
    EXPECT_EQ(resumed.result.history.size(), whole.result.history.size()) << at;
    // What was saved before is not saved once more.
    for (const Saved& one : later) EXPECT_GT(one.iteration, saved[at].iteration) << at;
  }
}

TEST(OptimiseOnGeometry, BeginsAnewIfACheckpointIsDamaged) {
  std::vector<Saved> saved;
  const ResultOnGeometry whole = on_cylinder(SlideOn::Auto, {}, saving(saved));
  ASSERT_FALSE(saved.empty());
  const std::string& bytes = saved.back().bytes;
  for (const std::string& damaged :
       {std::string("no checkpoint"), bytes.substr(0, 20), bytes.substr(0, bytes.size() / 2)}) {
    RunControl control;
    control.checkpoint = damaged;
    EXPECT_EQ(on_cylinder(SlideOn::Auto, {}, control).result.mesh.coordinates, whole.result.mesh.coordinates);
  }
}

TEST(OptimiseOnGeometry, CurvesAStraightMeshFirst) {
  const HighOrderMesh straight = DiscMesh(2, 1).mesh();
  GeometryOptions geometry;
  geometry.order = 3;
  const auto done = optimise_on_geometry(straight, {}, geometry, &cylinder());
  ASSERT_TRUE(done) << done.error().sentence;
  EXPECT_EQ(done->result.mesh.order, 3);
  geometry.order = 11;
  EXPECT_EQ(optimise_on_geometry(straight, {}, geometry, &cylinder()).error().kind, Error::Kind::BadOption);
}

TEST(OptimiseOnGeometry, NeedsMemoryForTheMeshAsItCameAndTheBest) {
  EXPECT_GT(memory_needed_on_geometry(disc(), {}, {}), memory_needed(disc(), {}));
  GeometryOptions curved;
  curved.order = 3;
  const HighOrderMesh straight = DiscMesh(2, 1).mesh();
  EXPECT_GT(memory_needed_on_geometry(straight, {}, curved), memory_needed_on_geometry(straight, {}, {}));
}

}  // namespace
}  // namespace varimesh
