// Objective::Worst raises the proved minimum of the scaled Jacobian and hardly lowers its mean.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"

namespace varimesh {
namespace {

class WorstObjective : public ::testing::TestWithParam<std::string> {
 protected:
  HighOrderMesh mesh() const { return testing::read_case(GetParam() + ".msh"); }
};

TEST_P(WorstObjective, RaisesTheLowestScaledJacobianAndKeepsTheMean) {
  Options options = testing::for_energy();
  const auto energy = optimise(mesh(), options);
  options.objective = Objective::Worst;
  const auto worst = optimise(mesh(), options);
  ASSERT_TRUE(energy && worst);
  EXPECT_TRUE(worst->stop_reason == StopReason::Converged || worst->stop_reason == StopReason::NoProgress);
  EXPECT_EQ(worst->converged, worst->stop_reason == StopReason::Converged);
  EXPECT_EQ(worst->after.certified.invalid + worst->after.certified.undecided, 0);
  EXPECT_GT(worst->after.certified.min_scaled_jacobian_lower_bound,
            energy->after.certified.min_scaled_jacobian_lower_bound + 0.02);
  EXPECT_GE(worst->after.mean_scaled_jacobian, energy->after.mean_scaled_jacobian - 0.01);
  // There is one history. The iterations of the energy come first, and the later stages go on numbering.
  ASSERT_GT(worst->history.size(), energy->history.size());
  for (std::size_t i = 0; i < worst->history.size(); ++i) EXPECT_EQ(worst->history[i].number, static_cast<int>(i) + 1);
  EXPECT_EQ(worst->history[energy->history.size() - 1].energy, energy->history.back().energy);
  const HighOrderMesh before = mesh();
  const std::vector<bool> fixed = fixed_nodes(before);
  for (std::size_t n = 0; n < before.node_count(); ++n)
    for (std::size_t c = 0; fixed[n] && c < 3; ++c)
      ASSERT_EQ(worst->mesh.coordinates[3 * n + c], before.coordinates[3 * n + c]);
}

TEST_P(WorstObjective, AStopLeavesTheBestMeshSoFar) {
  Options options = testing::for_energy();
  const auto energy = optimise(mesh(), options);
  options.objective = Objective::Worst;
  const int last = energy->iterations + 2;  // in the second stage
  const auto stopped = optimise(mesh(), options, [last](const Iteration& iteration) {
    return iteration.number == last ? Control::Stop : Control::Continue;
  });
  ASSERT_TRUE(stopped);
  EXPECT_TRUE(stopped->stopped);
  EXPECT_GE(stopped->after.certified.min_scaled_jacobian_lower_bound,
            energy->after.certified.min_scaled_jacobian_lower_bound);
}

TEST_P(WorstObjective, HandsOutTheBestMeshThatALaterStagePassedThrough) {
  Options options = testing::for_energy();
  const auto energy = optimise(mesh(), options);
  options.objective = Objective::Worst;
  double highest = energy->after.certified.min_scaled_jacobian_lower_bound;
  for (const int more : {1, 2, 3, 4, 6, 1000}) {
    options.max_iterations = energy->iterations + more;
    const auto worst = optimise(mesh(), options);
    ASSERT_TRUE(worst);
    // The bound of a report is within 0.002 of the minimum.
    EXPECT_GE(worst->after.certified.min_scaled_jacobian_lower_bound, highest - 0.002) << more;
    highest = std::max(highest, worst->after.certified.min_scaled_jacobian_lower_bound);
  }
}

TEST_P(WorstObjective, EndsALaterStageBeforeItsOptimumAndSaysSo) {
  Options options;
  options.objective = Objective::Worst;
  const auto worst = optimise(mesh(), options);
  ASSERT_TRUE(worst);
  EXPECT_EQ(worst->stop_reason, StopReason::NoProgress);
  EXPECT_FALSE(worst->converged) << "the last stage ended before its optimum";
}

TEST(WorstObjective, MakesNoFurtherStageIfACellCannotBeCertified) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  Options options = testing::for_energy();
  const auto energy = optimise(mesh, options);
  options.objective = Objective::Worst;
  RunControl control;
  control.another_follows = true;  // so the default is not tried
  const auto worst = optimise(mesh, options, {}, control);
  ASSERT_TRUE(energy && worst);
  ASSERT_GT(energy->after.certified.invalid, 0);
  ASSERT_NE(energy->stop_reason, StopReason::Iterations);
  EXPECT_EQ(worst->iterations, energy->iterations);
  EXPECT_EQ(worst->mesh.coordinates, energy->mesh.coordinates);
}

TEST(WorstObjective, ExcludesAMinimumToStopAt) {
  Options options;
  options.objective = Objective::Worst;
  options.until_js = 0.3;
  const auto checked = check(options);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().kind, Error::Kind::BadOption);
}

INSTANTIATE_TEST_SUITE_P(Cases, WorstObjective, ::testing::Values("circle_p5", "aerofoil_p4", "sphere_p3"),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace varimesh
