// Elements that one way leaves invalid are not given up before the others have been tried.
#include "core/optimise/sequences/attempts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/optimise/optimiser.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"

namespace varimesh {
namespace {

Result run(const std::string& name, const Options& options = {}, const OnIteration& on_iteration = {}) {
  auto result = optimise(testing::read_case(name), options, on_iteration);
  EXPECT_TRUE(result) << (result ? "" : result.error().sentence);
  return result ? std::move(*result) : Result{};
}

std::string notes(const Result& result) {
  std::string all;
  for (const std::string& note : result.notes) all += note + "\n";
  return all;
}

/// Meshes that the first way leaves invalid. Another program has made the re-entrant corners valid. The nine
/// quadrilaterals need more work than the run before.
class OtherWays : public ::testing::TestWithParam<std::string> {};

TEST_P(OtherWays, MakeAMeshValidThatTheFirstLeaves) {
  const Result result = run(GetParam() + ".msh");
  EXPECT_FALSE(result.before.uncertified.empty());
  EXPECT_TRUE(result.after.uncertified.empty());
  EXPECT_NE(notes(result).find("So the run went on from there."), std::string::npos) << notes(result);
  for (std::size_t i = 0; i < result.history.size(); ++i) ASSERT_EQ(result.history[i].number, static_cast<int>(i) + 1);
  EXPECT_EQ(result.iterations, static_cast<int>(result.history.size()));
}

TEST_P(OtherWays, AreLeftToTheUserWhoNamesOne) {
  EXPECT_FALSE(run(GetParam() + ".msh", testing::for_energy()).after.uncertified.empty());
}

TEST_P(OtherWays, EndWhenTheCallerStops) {
  const int first = run(GetParam() + ".msh", testing::for_energy()).iterations;
  const Result whole = run(GetParam() + ".msh");
  ASSERT_GT(whole.iterations, 20);
  const int last = std::min(first, whole.iterations - 1) + 1;
  const Result stopped = run(GetParam() + ".msh", {}, [last](const Iteration& iteration) {
    return iteration.number == last ? Control::Stop : Control::Continue;
  });
  EXPECT_TRUE(stopped.stopped);
  EXPECT_EQ(stopped.stop_reason, StopReason::Stopped);
  EXPECT_EQ(stopped.iterations, last);
  EXPECT_LE(stopped.after.uncertified.size(), stopped.before.uncertified.size());
}

INSTANTIATE_TEST_SUITE_P(Meshes, OtherWays,
                         ::testing::Values("reentrant_3_of_5", "reentrant_4_of_6", "nine_quadrilaterals_p6"),
                         [](const auto& info) { return info.param; });

TEST(OtherWays, LowerTheLossOfAValidMeshThatTheDescentLeaves) {
  const Result result = run("pin_p3.msh");
  ASSERT_TRUE(result.before.uncertified.empty() && result.after.uncertified.empty());
  EXPECT_LT(result.after.accuracy->loss, 0.7 * result.before.accuracy->loss);
  EXPECT_GE(result.after.min_scaled_jacobian, result.before.min_scaled_jacobian);
  EXPECT_EQ(notes(result).find("nothing was moved"), std::string::npos) << notes(result);
}

TEST(OtherWays, LetWorstEndNoLowerThanTheDefault) {
  Options worst;
  worst.objective = Objective::Worst;
  const Result lowest = run("reentrant_triangles_p2.msh"), raised = run("reentrant_triangles_p2.msh", worst);
  ASSERT_TRUE(raised.after.uncertified.empty());
  EXPECT_GE(raised.after.min_scaled_jacobian, lowest.after.min_scaled_jacobian - 1e-3);
  EXPECT_GT(raised.after.min_scaled_jacobian, 0.9);  // by its own way it ends at .69
}

// Straight-sided elements have no loss, so the default is another objective there.
TEST(OtherWays, LetWorstEndNoLowerThanTheDefaultOnAMeshOfOrderOne) {
  Options worst;
  worst.objective = Objective::Worst;
  const Result lowest = run("reentrant_2_of_5.msh"), raised = run("reentrant_2_of_5.msh", worst);
  ASSERT_TRUE(raised.after.uncertified.empty());
  EXPECT_GE(raised.after.min_scaled_jacobian, lowest.after.min_scaled_jacobian);
  EXPECT_GT(raised.after.min_scaled_jacobian, 0.02);  // by its own way it ends at .014
}

// One element cannot be repaired. By its own way `worst` ends with -.093 there.
TEST(OtherWays, LetWorstEndNoLowerThanTheDefaultWhereElementsAreLeft) {
  Options worst;
  worst.objective = Objective::Worst;
  const Result lowest = run("cone_p3.msh"), raised = run("cone_p3.msh", worst);
  ASSERT_EQ(lowest.after.uncertified.size(), 1U);
  ASSERT_EQ(raised.after.uncertified.size(), 1U);
  EXPECT_GE(raised.after.min_scaled_jacobian, lowest.after.min_scaled_jacobian);
  EXPECT_GT(raised.after.min_scaled_jacobian, -0.085);
  EXPECT_NE(notes(raised).find("With the default objective, 1 element is not certified valid, the smallest"),
            std::string::npos)
      << notes(raised);
}

/// The mesh and the set-up are those of the first run again, although attempts free their tables.
TEST(OtherWays, SayIfTheNextOrderLeavesFewer) {
  const Result result = run("reentrant_2_of_4.msh");
  ASSERT_EQ(result.left.uncertified, 1);
  EXPECT_EQ(result.mesh.order, 1);
  ASSERT_FALSE(result.left.remedies.empty());
  EXPECT_EQ(result.left.remedies.front().kind, Remedy::Kind::RaiseOrder);
  EXPECT_EQ(result.left.remedies.front().order, 2);
  EXPECT_EQ(result.left.remedies.front().elements, 1);
  Options options;
  options.order = 2;
  EXPECT_TRUE(run("reentrant_2_of_4.msh", options).after.uncertified.empty());
}

TEST(OtherWays, LeaveAnOptimiserAsItWas) {
  const HighOrderMesh mesh = testing::read_case("reentrant_4_of_6.msh");
  auto optimiser = Optimiser::create(mesh);
  ASSERT_TRUE(optimiser);
  const auto first = optimiser->run(mesh.coordinates), second = optimiser->run(mesh.coordinates);
  ASSERT_TRUE(first && second);
  EXPECT_TRUE(second->after.uncertified.empty());
  EXPECT_EQ(first->mesh.coordinates, second->mesh.coordinates);
}

TEST(OtherWays, AreTriedOnlyIfNoOptionNamesOne) {
  EXPECT_TRUE(may_try_other_ways({}));
  Options options;
  options.objective = Objective::Worst;
  EXPECT_TRUE(may_try_other_ways(options));
  options.energy = Energy::Winslow;
  EXPECT_FALSE(may_try_other_ways(options));
  EXPECT_FALSE(may_try_other_ways(testing::for_energy()));
  options = {};
  options.repair = Repair::Split;
  EXPECT_FALSE(may_try_other_ways(options));
}

}  // namespace
}  // namespace varimesh
