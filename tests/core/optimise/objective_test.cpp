// What Objective::Worst promises: a higher lowest scaled Jacobian, proved, at hardly any cost to the mean.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/problem/targets.h"
#include "tests/core/support/cases.h"

namespace varimesh {
namespace {

class WorstObjective : public ::testing::TestWithParam<std::string> {
 protected:
  HighOrderMesh mesh() const { return testing::read_case(GetParam() + ".msh"); }
};

TEST_P(WorstObjective, RaisesTheLowestScaledJacobianAndKeepsTheMean) {
  Options options;
  const auto energy = optimise(mesh(), options);
  options.objective = Objective::Worst;
  const auto worst = optimise(mesh(), options);
  ASSERT_TRUE(energy && worst);
  EXPECT_TRUE(worst->converged);
  EXPECT_EQ(worst->after.certified.invalid + worst->after.certified.undecided, 0);
  EXPECT_GT(worst->after.certified.min_scaled_jacobian_lower_bound,
            energy->after.certified.min_scaled_jacobian_lower_bound + 0.02);
  EXPECT_GE(worst->after.mean_scaled_jacobian, energy->after.mean_scaled_jacobian - 0.01);
  // One history: the energy's run comes first, and the numbers go on.
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
  Options options;
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

TEST(WorstObjective, ExcludesAMinimumToStopAt) {
  Options options;
  options.objective = Objective::Worst;
  options.until_js = 0.3;
  const auto checked = check(options);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().kind, Error::Kind::BadOption);
}

TEST(LevelTargets, KeepShapeAndMeasure) {
  const HighOrderMesh mesh = testing::read_case("annulus_p3.msh");
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  problem.positions = solver_positions(mesh, frame_of(mesh));
  set_straight_sided_targets(problem);
  Problem level = problem;
  level_targets(level);
  const CellSet &before = problem.sets[0], &after = level.sets[0];
  ASSERT_FALSE(before.affine);
  bool uneven = false;
  for (std::int32_t cell = 0; cell < before.count; ++cell) {
    double measure = 0, level_measure = 0, first = 0;
    for (int q = 0; q < before.points; ++q) {
      const auto entry = [&](const CellSet& block, int k) {
        return block.inverse_target_of(cell)[k * block.stride + q];
      };
      const auto determinant = [&](const CellSet& block) {
        return entry(block, 0) * entry(block, 3) - entry(block, 1) * entry(block, 2);
      };
      if (q == 0) first = determinant(after);
      EXPECT_NEAR(determinant(after), first, 1e-12 * std::abs(first));
      uneven = uneven || std::abs(determinant(before) - first) > 1e-3 * std::abs(first);
      const double scale = std::sqrt(determinant(after) / determinant(before));
      for (int k = 0; k < 4; ++k) EXPECT_NEAR(entry(after, k), scale * entry(before, k), 1e-12 * std::abs(first));
      const std::size_t at = static_cast<std::size_t>(cell) * before.stride + q;
      measure += before.measure[at];
      level_measure += after.measure[at];
    }
    EXPECT_NEAR(level_measure, measure, 1e-12 * measure);
  }
  EXPECT_TRUE(uneven);
}

INSTANTIATE_TEST_SUITE_P(Cases, WorstObjective, ::testing::Values("circle_p5", "aerofoil_p4", "sphere_p3"),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace varimesh
