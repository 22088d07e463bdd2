// Whole runs with --repair split on meshes that no movement of nodes can make valid.
#include "core/optimise/sequences/splitting.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "core/optimise/sequences/raise_left.h"
#include "core/optimise/sequences/run_sequence.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

Options with(Repair repair, int threads = 1) {
  Options options = testing::for_energy();
  options.repair = repair;
  options.threads = threads;
  options.max_iterations = 60;
  return options;
}

Result run(const HighOrderMesh& mesh, const Options& options, const OnIteration& on_iteration = {}) {
  auto result = optimise(mesh, options, on_iteration);
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}

void expect_same_boundary(const HighOrderMesh& before, const HighOrderMesh& after) {
  const std::vector<bool> fixed = fixed_nodes(before);
  for (std::size_t n = 0; n < before.node_count(); ++n) {
    EXPECT_EQ(before.node_numbers[n], after.node_numbers[n]);
    if (fixed[n]) {
      EXPECT_EQ(std::memcmp(&before.coordinates[3 * n], &after.coordinates[3 * n], 3 * sizeof(double)), 0);
    }
  }
}

TEST(RepairBySplitting, MakesMeshesValidThatReportLeavesInvalid) {
  for (const HighOrderMesh& mesh : {testing::six_in_a_ball(3), testing::two_in_a_ball(3)}) {
    const Result reported = run(mesh, with(Repair::Report));
    EXPECT_EQ(reported.after.uncertified.size(), mesh.element_count(3));
    EXPECT_FALSE(reported.unrepairable.empty());
    EXPECT_TRUE(reported.repairs.empty());
    const Result repaired = run(mesh, with(Repair::Split));
    EXPECT_TRUE(repaired.after.uncertified.empty());
    EXPECT_TRUE(repaired.unrepairable.empty());
    EXPECT_EQ(repaired.before.certified.invalid, reported.before.certified.invalid);
    EXPECT_EQ(repaired.sizes.elements, static_cast<std::int64_t>(repaired.mesh.element_count(3)));
    EXPECT_GT(repaired.mesh.element_count(3), mesh.element_count(3));
    EXPECT_FALSE(repaired.repairs.empty());
    expect_same_boundary(mesh, repaired.mesh);
    EXPECT_NEAR(testing::volume(repaired.mesh) / testing::volume(mesh), 1, 1e-12);
  }
}

TEST(RepairBySplitting, IsARunWithoutSplitsIfMovementRepairsTheMesh) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  Options options = with(Repair::Report);
  options.objective = Objective::Worst;
  options.max_iterations = 1000;
  const Result reported = run(mesh, options);
  options.repair = Repair::Split;
  const Result split = run(mesh, options);
  ASSERT_TRUE(reported.after.uncertified.empty());
  EXPECT_TRUE(split.after.uncertified.empty());
  EXPECT_TRUE(split.repairs.empty());
  EXPECT_NEAR(split.after.min_scaled_jacobian, reported.after.min_scaled_jacobian, 0.01);
}

TEST(RepairBySplitting, SaysHowManyGroupsEachLookHasFound) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  std::vector<Work> looks;
  WorkMeter meter([&](const Work& work) { looks.push_back(work); });
  RunControl control;
  control.meter = &meter;
  std::vector<std::int64_t> groups;
  const auto result = optimise(
      mesh, with(Repair::Split),
      [&](const Iteration& iteration) {
        groups.push_back(iteration.groups_left);
        return Control::Continue;
      },
      control);
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->after.uncertified.empty());
  EXPECT_EQ(groups.front(), -1) << "no look before the run without a split";
  EXPECT_EQ(groups.back(), 0) << "the last look of a round finds nothing that may be split";
  EXPECT_FALSE(looks.empty());
}

TEST(RepairBySplitting, GivesItsRunsAllThatItIsGivenButCheckpoints) {
  WorkMeter meter([](const Work&) {});
  RunControl asked;
  asked.checkpoint_due = [](const Iteration&) { return true; };
  asked.save_checkpoint = [](const Iteration&, const WriteCheckpoint&) {};
  asked.checkpoint = "not empty";
  asked.threads = [] { return 3; };
  asked.stop_asked = [] { return true; };
  asked.meter = &meter;
  asked.spare_memory = {[](std::int64_t bytes) { return bytes / 2; }, [](std::int64_t) {}};
  const RunControl control = control_of_each_run(asked);
  EXPECT_FALSE(control.checkpoint_due || control.save_checkpoint);
  EXPECT_TRUE(control.checkpoint.empty() && control.shallow_untangling && control.untangles_lost);
  EXPECT_EQ(control.threads(), 3);
  EXPECT_TRUE(control.stop_asked());
  EXPECT_EQ(control.meter, &meter);
  ASSERT_TRUE(control.spare_memory.take && control.spare_memory.give_back);
  EXPECT_EQ(control.spare_memory.take(10), 5);
}

TEST(RepairBySplitting, RaisesTheElementsThatSplitsHaveLeft) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {2, 2, 2}, 2);
  testing::shake(mesh, 0.05, 3);
  Options options = with(Repair::Report);
  options.max_iterations = 0;
  const Result tangled = run(mesh, options);
  const std::vector<std::int64_t> left = uncertified_numbers(tangled.after);
  ASSERT_GT(left.size(), 1u);
  StopToken stop;
  Result nothing = tangled;
  raise_left(nothing, {}, options, stop);
  EXPECT_EQ(nothing.mesh.coordinates, mesh.coordinates);
  EXPECT_TRUE(nothing.notes == tangled.notes);
  // No movement of nodes makes either of these two tetrahedra valid. Their nodes go back to where they were.
  Options no_steps = with(Repair::Report);
  no_steps.max_iterations = 0;
  Result in_vain = run(testing::two_in_a_ball(3), no_steps);
  const std::vector<double> before = in_vain.mesh.coordinates;
  raise_left(in_vain, uncertified_numbers(in_vain.after), no_steps, stop);
  EXPECT_EQ(in_vain.mesh.coordinates, before);
  Result raised = tangled;
  raise_left(raised, left, options, stop);
  EXPECT_TRUE(raised.after.uncertified.empty()) << raised.after.uncertified.size() << " of " << left.size();
  EXPECT_EQ(raised.notes.size(), tangled.notes.size() + 1);
  expect_same_boundary(mesh, raised.mesh);
}

TEST(RepairBySplitting, NamesEachElementThatIsLeftOnce) {
  // The tetrahedron's face 0 1 2 folds within its plane, so nothing inside can help.
  HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](testing::Place p) { return p; });
  mesh.coordinates[3 * 4 + 1] += 1.2;
  const Result result = run(mesh, with(Repair::Split));
  ASSERT_EQ(result.after.uncertified.size(), 1u);
  ASSERT_EQ(result.repairs.size(), 1u);
  EXPECT_EQ(result.repairs[0].kind, RepairStep::Kind::Left);
  EXPECT_EQ(result.repairs[0].elements, uncertified_numbers(result.after));
  EXPECT_NE(result.repairs[0].sentence.find("folds over itself"), std::string::npos) << result.repairs[0].sentence;
}

TEST(RepairBySplitting, DoesNotDependOnTheNumberOfThreads) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const Result one = run(mesh, with(Repair::Split)), three = run(mesh, with(Repair::Split, 3));
  EXPECT_EQ(one.mesh.coordinates, three.mesh.coordinates);
  EXPECT_EQ(one.mesh.node_numbers, three.mesh.node_numbers);
}

TEST(RepairBySplitting, LowersTheLossOfAccuracyOfWhatItMakesValid) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  Options options = with(Repair::Split);
  const Result energy = run(mesh, options);
  options.objective = Objective::Accuracy;
  options.min_js = 0;  // the energy ends with .013
  const Result accurate = run(mesh, options);
  EXPECT_TRUE(accurate.after.uncertified.empty());
  EXPECT_EQ(accurate.history.back().phase, Phase::Accuracy);
  EXPECT_LT(accurate.after.accuracy->loss, energy.after.accuracy->loss);
}

TEST(RepairBySplitting, SplitsNothingInAValidMesh) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {2, 2, 2}, 2, testing::bent(3));
  const Result result = run(mesh, with(Repair::Split)), plain = run(mesh, with(Repair::Report));
  EXPECT_TRUE(result.repairs.empty());
  EXPECT_EQ(result.mesh.coordinates, plain.mesh.coordinates);
  EXPECT_EQ(result.iterations, plain.iterations);
}

TEST(RepairBySplitting, TriesOtherWaysOnMeshesOfOrderOneToo) {
  const HighOrderMesh mesh = testing::read_case("reentrant_3_of_5.msh");
  Options options;
  const Result plain = run(mesh, options);
  ASSERT_TRUE(plain.after.uncertified.empty());
  options.repair = Repair::Split;
  EXPECT_TRUE(run(mesh, options).after.uncertified.empty());
}

TEST(RepairBySplitting, SaysThatItIsNotOfferedForOtherShapes) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Hexahedra, {1, 1, 1}, 3, [](testing::Place x) {
    return testing::Place{x[0] - .5, x[1] - .5, x[2] - .5};
  });
  testing::round_off(mesh);
  const Result result = run(mesh, with(Repair::Split));
  ASSERT_EQ(result.repairs.size(), 1u);
  EXPECT_EQ(result.repairs[0].kind, RepairStep::Kind::Left);
  EXPECT_NE(result.repairs[0].sentence.find("Only tetrahedra can be split"), std::string::npos)
      << result.repairs[0].sentence;
  EXPECT_EQ(result.mesh.element_count(3), 1u);
}

TEST(RepairBySplitting, SplitsNothingInPlaneMeshes) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Triangles, {2, 2, 1}, 4);
  const Cells cells(mesh, 2);
  mesh.coordinates[3 * static_cast<std::size_t>(cells.nodes(0)[14])] -= 0.6;  // an inner node turns the triangle over
  const Result result = run(mesh, with(Repair::Split));
  EXPECT_FALSE(result.before.uncertified.empty());
  EXPECT_TRUE(result.after.uncertified.empty());
  EXPECT_EQ(result.mesh.node_numbers, mesh.node_numbers);
  EXPECT_TRUE(result.repairs.empty());
}

TEST(RepairBySplitting, ReturnsNothingWorseIfStopped) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const Result result = run(mesh, with(Repair::Split), [](const Iteration&) { return Control::Stop; });
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.stop_reason, StopReason::Stopped);
  EXPECT_EQ(result.history.size(), 1u);
  EXPECT_LE(result.after.uncertified.size(), result.before.uncertified.size());
  expect_same_boundary(mesh, result.mesh);
}

TEST(RepairBySplitting, IsStoppedWhileItSplits) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  for (int answers = 0; answers < 6; ++answers) {
    int asked = 0;
    RunControl control;
    control.stop_asked = [&] { return asked++ >= answers; };
    const auto result = optimise(mesh, with(Repair::Split), {}, control);
    ASSERT_TRUE(result);
    EXPECT_TRUE(result->stopped) << answers;
    EXPECT_EQ(result->stop_reason, StopReason::Stopped);
    EXPECT_EQ(result->iterations, 0) << "no iteration is begun";
    EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
    EXPECT_EQ(asked, answers + 1) << "stop_asked is not called again";
  }
}

TEST(RepairBySplitting, SaysWhichLimitEndedIt) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  Options options = with(Repair::Split);
  const Result whole = run(mesh, options);
  ASSERT_TRUE(whole.after.uncertified.empty());
  EXPECT_NE(whole.stop_reason, StopReason::Iterations);
  options.max_iterations = 1;
  const Result one = run(mesh, options);
  EXPECT_EQ(one.iterations, 1);
  EXPECT_EQ(one.stop_reason, StopReason::Iterations);
  options.max_iterations = 60;
  options.time_limit = 1e-9;
  const Result none = run(mesh, options);
  ASSERT_FALSE(none.after.uncertified.empty());
  EXPECT_EQ(none.stop_reason, StopReason::TimeLimit);
}

TEST(RepairBySplitting, ChecksOnlyWithoutIterations) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  Options options = with(Repair::Split);
  options.max_iterations = 0;
  const Result result = run(mesh, options);
  EXPECT_EQ(result.mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(result.mesh.element_count(3), 6u);
}

TEST(RepairBySplitting, RunsAgainOnOneOptimiser) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  auto optimiser = Optimiser::create(mesh, with(Repair::Split));
  ASSERT_TRUE(optimiser) << optimiser.error().sentence;
  const auto first = optimiser->run(mesh.coordinates), second = optimiser->run(mesh.coordinates);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->mesh.element_count(3), 12u);
  EXPECT_EQ(first->mesh.coordinates, second->mesh.coordinates);
}

TEST(RepairBySplitting, RefusesRegionsAndTargetFields) {
  Options options = with(Repair::Split);
  options.region_below = 0.5;
  EXPECT_FALSE(check(options));
  options.region_below = 0;
  options.target = Target::Size;
  options.target_field.values = {1};
  EXPECT_FALSE(check(options));
}

TEST(RepairNone, NamesUnrepairableCellsAndKeepsThemInTheBarrier) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const Result none = run(mesh, with(Repair::None)), reported = run(mesh, with(Repair::Report));
  EXPECT_EQ(none.unrepairable.size(), reported.unrepairable.size());
  EXPECT_TRUE(none.repairs.empty());
  EXPECT_NE(none.mesh.coordinates, reported.mesh.coordinates);
}

}  // namespace
}  // namespace varimesh
