// Objective::Accuracy lowers the loss of accuracy, and the error of a solver with it, and keeps every certificate.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "core/validity/certificate.h"
#include "tests/core/accuracy/plain_poisson.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::PlainPoisson;
using testing::read_case;

Options for_accuracy() {
  Options options;
  options.objective = Objective::Accuracy;
  options.threads = 1;
  return options;
}

double error_of_a_solver(const HighOrderMesh& mesh) { return PlainPoisson(mesh).errors().in_gradient; }

bool all_valid(const HighOrderMesh& mesh) { return std::ranges::all_of(certify(mesh, {}, 1), &Certificate::is_valid); }

TEST(AccuracyObjective, LowersTheErrorOfASolverOnMeshesThatCameInValid) {
  // The largest shares of the start's error that are left.
  for (const auto& [name, share] : {std::pair{"disc_p4.msh", 0.6}, std::pair{"solid_ball_p3.msh", 1.0}}) {
    const HighOrderMesh mesh = read_case(name);
    if (!all_valid(mesh)) continue;
    const auto result = optimise(mesh, for_accuracy());
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_TRUE(all_valid(result->mesh)) << name;
    EXPECT_LE(result->after.accuracy->loss, result->before.accuracy->loss) << name;
    EXPECT_LE(error_of_a_solver(result->mesh), share * error_of_a_solver(mesh)) << name;
    EXPECT_EQ(result->stop_reason, StopReason::Converged) << name;
    EXPECT_EQ(result->history.back().phase, Phase::Accuracy) << name;
  }
}

TEST(AccuracyObjective, CostsLessThanTheEnergyOnAMeshThatCameInInvalid) {
  const HighOrderMesh mesh = read_case("sphere_p3.msh");
  ASSERT_FALSE(all_valid(mesh));
  const auto accurate = optimise(mesh, for_accuracy()), energy = optimise(mesh);
  ASSERT_TRUE(accurate && energy);
  ASSERT_TRUE(all_valid(accurate->mesh));
  EXPECT_GE(accurate->after.certified.min_scaled_jacobian_lower_bound, 0.1 - 1e-3);
  EXPECT_LT(error_of_a_solver(accurate->mesh), 0.7 * error_of_a_solver(energy->mesh));
}

TEST(AccuracyObjective, KeepsTheBoundOnTheScaledJacobian) {
  const HighOrderMesh mesh = read_case("annulus_p3.msh");
  Options options = for_accuracy();
  options.min_js = 0.7;
  const auto bounded = optimise(mesh, options);
  options.min_js = 0;
  const auto unbounded = optimise(mesh, options);
  ASSERT_TRUE(bounded && unbounded);
  EXPECT_GE(bounded->after.certified.min_scaled_jacobian_lower_bound, 0.7 - 1e-3);
  EXPECT_LE(unbounded->after.accuracy->loss, bounded->after.accuracy->loss);
  EXPECT_LE(bounded->after.accuracy->loss, bounded->before.accuracy->loss);
}

TEST(AccuracyObjective, IsTheSameForEveryNumberOfThreads) {
  for (const char* name : {"disc_p4.msh", "sphere_p3.msh"}) {
    Options options = for_accuracy();
    const auto one = optimise(read_case(name), options);
    options.threads = 3;
    const auto three = optimise(read_case(name), options);
    ASSERT_TRUE(one && three);
    EXPECT_EQ(one->mesh.coordinates, three->mesh.coordinates) << name;
  }
}

TEST(AccuracyObjective, AStopLeavesTheBestMeshSoFar) {
  const HighOrderMesh mesh = read_case("disc_p4.msh");
  double loss = 1;
  for (int rounds = 1; rounds <= 4; ++rounds) {
    const auto stopped = optimise(mesh, for_accuracy(), [rounds](const Iteration& iteration) {
      return iteration.number == rounds ? Control::Stop : Control::Continue;
    });
    ASSERT_TRUE(stopped);
    EXPECT_TRUE(all_valid(stopped->mesh));
    EXPECT_LE(stopped->after.accuracy->loss, loss) << rounds;
    loss = stopped->after.accuracy->loss;
  }
  EXPECT_LT(loss, accuracy(mesh).loss);
}

TEST(AccuracyObjective, LeavesFixedNodesAndStraightSidedMeshesAsTheyAre) {
  const HighOrderMesh mesh = read_case("disc_p4.msh");
  const auto result = optimise(mesh, for_accuracy());
  ASSERT_TRUE(result);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t c = 0; fixed[n] && c < 3; ++c)
      ASSERT_EQ(result->mesh.coordinates[3 * n + c], mesh.coordinates[3 * n + c]);
  const HighOrderMesh straight = testing::grid(Filling::Triangles, {3, 3, 1}, 3);
  const auto same = optimise(straight, for_accuracy());
  ASSERT_TRUE(same);
  EXPECT_EQ(same->mesh.coordinates, straight.coordinates);
}

class AccuracyObjectiveOn : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, AccuracyObjectiveOn, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return std::string(testing::name(filling.param)); });

TEST_P(AccuracyObjectiveOn, NeverRaisesTheLossOfAValidMesh) {
  for (int order = 2; order <= 4; ++order) {
    HighOrderMesh mesh =
        testing::grid(GetParam(), {3, 3, 2}, order, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh, 0.01, 3);
    if (!all_valid(mesh)) continue;
    const auto result = optimise(mesh, for_accuracy());
    ASSERT_TRUE(result);
    EXPECT_TRUE(all_valid(result->mesh)) << "order " << order;
    EXPECT_LT(result->after.accuracy->loss, 0.9 * result->before.accuracy->loss) << "order " << order;
  }
}

}  // namespace
}  // namespace varimesh
