// Objective::Accuracy lowers the loss of accuracy, and the error of a solver with it, and keeps every certificate.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/formats/formats.h"
#include "core/merit/thresholds.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/validity/certificate.h"
#include "tests/core/quality/accuracy/plain_poisson.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::for_energy;
using testing::PlainPoisson;
using testing::read_case;

Options for_accuracy() {
  Options options;
  options.objective = Objective::Accuracy;
  options.threads = 1;
  return options;
}

double error_of_a_solver(const HighOrderMesh& mesh) { return PlainPoisson(mesh).errors().in_gradient; }

/// What the descent lowers.
double local_loss_of(const HighOrderMesh& mesh) { return local_loss(mesh, mesh.coordinates, Team(1)); }

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
  const auto accurate = optimise(mesh, for_accuracy()), energy = optimise(mesh, for_energy());
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
  EXPECT_LE(local_loss_of(unbounded->mesh), local_loss_of(bounded->mesh));
  EXPECT_LE(bounded->after.accuracy->loss, bounded->before.accuracy->loss);
}

// A boundary layer of prisms, 40 of them invalid. Nodes of thin cells move so far in a round that the loss rises, so
// the descent must take rounds back; and the quadrature points see a higher scaled Jacobian than the proof.
TEST(AccuracyObjective, HasTheBoundInABoundaryLayer) {
  const char* folder = std::getenv("VARIMESH_CASES");
  const auto file = formats::read_file(std::string(folder ? folder : "") + "/meshes/sphbl_p2.msh");
  if (!file) GTEST_SKIP() << "NOT RUN: the shared cases are not there; set VARIMESH_CASES to their folder.";
  Options options = for_accuracy();
  const auto result = optimise(file->mesh, options);
  ASSERT_TRUE(result);
  EXPECT_TRUE(all_valid(result->mesh));
  EXPECT_GE(result->after.certified.min_scaled_jacobian_lower_bound, options.min_js - 1e-3);
  EXPECT_LT(result->after.accuracy->loss, 4.8e-3);  // 4.72e-3 at the energy's optimum
}

/// Folds three triangles of the boundary: moves the node in their middle beyond a corner.
void fold_boundary(HighOrderMesh& mesh) {
  std::vector<const std::int32_t*> triangles;
  for (const ElementBlock& block : mesh.blocks)
    for (std::size_t i = 0; block.shape == Shape::Triangle && i < block.size(); ++i)
      triangles.push_back(block.nodes.data() + 10 * i);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int32_t* nodes = triangles.at((68 + k * triangles.size() / 3) % triangles.size());
    const auto x = [&](int node) { return mesh.coordinates.data() + 3 * static_cast<std::size_t>(nodes[node]); };
    for (int d = 0; d < 3; ++d) x(9)[d] = 1.4 * x(0)[d] - 0.2 * x(1)[d] - 0.2 * x(2)[d];
  }
}

// Nothing inside can repair the cells at a boundary edge on which J is negative. A solver cannot use such a mesh, and
// if these cells are small beside the others, they cost less than the size of the others.
TEST(AccuracyObjective, LowersTheLossOfAMeshThatStaysInvalidOnlyIfItIsWorthIt) {
  for (const bool is_small : {false, true}) {
    const auto graded = [&](testing::Place p) {
      for (double& x : p) x = is_small ? x * x * x : x;
      return p;
    };
    HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {3, 3, 3}, 3, graded);
    const ElementBlock& side = *std::ranges::find(mesh.blocks, Shape::Triangle, &ElementBlock::shape);
    const auto x = [&](std::size_t node) { return &mesh.coordinates[3 * static_cast<std::size_t>(side.nodes[node])]; };
    for (int d = 0; d < 3; ++d) {
      x(3)[d] = 0.38 * x(0)[d] + 0.62 * x(1)[d];
      x(4)[d] = 0.05 * x(0)[d] + 0.95 * x(1)[d];
    }
    const auto result = optimise(mesh, for_accuracy());
    ASSERT_TRUE(result);
    EXPECT_FALSE(result->after.uncertified.empty());
    const bool descends = std::ranges::any_of(
        result->history, [](const Iteration& iteration) { return iteration.phase == Phase::Accuracy; });
    const bool says_so = std::ranges::any_of(result->notes, [](const std::string& note) {
      return note.find("was not lowered further") != std::string::npos;
    });
    EXPECT_EQ(descends, !is_small);
    EXPECT_EQ(says_so, is_small);
  }
}

// The elements at the folds stay invalid. Raising others to the bound cannot give the mesh the bound.
TEST(AccuracyObjective, NeverRaisesTheLossOfAMeshThatItWillLeaveInvalid) {
  HighOrderMesh mesh = read_case("small_ball_p3.msh");
  fold_boundary(mesh);
  const auto once = optimise(mesh, for_accuracy());
  ASSERT_TRUE(once);
  EXPECT_EQ(once->after.uncertified.size(), 3u);
  const auto again = optimise(once->mesh, for_accuracy());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->after.uncertified.size(), 3u);
  EXPECT_LE(again->after.accuracy->loss, once->after.accuracy->loss);
}

/// Runs to the end and keeps the checkpoint after every iteration.
Expected<Result> with_checkpoints(const HighOrderMesh& mesh, const Options& options, std::vector<std::string>& kept) {
  RunControl control;
  control.checkpoint_due = [](const Iteration&) { return true; };
  control.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) {
    kept.emplace_back();
    write([&](std::string_view bytes) {
      kept.back() += bytes;
      return true;
    });
  };
  return optimise(mesh, options, {}, control);
}

TEST(AccuracyObjective, GoesOnFromACheckpointOfEveryRoundToTheSameBytes) {
  for (const char* name : {"sphere_p3.msh", "disc_p4.msh"}) {
    const HighOrderMesh mesh = read_case(name);
    std::vector<std::string> kept;
    const auto whole = with_checkpoints(mesh, for_accuracy(), kept);
    ASSERT_TRUE(whole);
    int rounds = 0;
    for (const std::string& checkpoint : kept) {
      RunControl control;
      control.checkpoint = checkpoint;
      const auto resumed = optimise(mesh, for_accuracy(), {}, control);
      ASSERT_TRUE(resumed);
      ASSERT_GT(resumed->resumed_from, 0) << name;
      rounds += whole->history[static_cast<std::size_t>(resumed->resumed_from) - 1].phase == Phase::Accuracy ? 1 : 0;
      EXPECT_EQ(resumed->mesh.coordinates, whole->mesh.coordinates) << name << " from " << resumed->resumed_from;
      EXPECT_EQ(resumed->iterations, whole->iterations);
      EXPECT_EQ(resumed->stop_reason, whole->stop_reason);
      EXPECT_EQ(resumed->after.certified.min_scaled_jacobian_lower_bound,
                whole->after.certified.min_scaled_jacobian_lower_bound);
    }
    EXPECT_GT(rounds, 1) << name;
  }
}

// The first rounds cost many cells their certificate and would leave a loss of 7.1e-3. Those that raise such cells
// follow.
TEST(AccuracyObjective, RaisesCellsThatLoseTheirCertificateIfTheRoundsWouldEndBelowTheBound) {
  const HighOrderMesh mesh = read_case("small_ball_p3.msh");
  std::vector<std::string> kept;
  const auto whole = with_checkpoints(mesh, for_accuracy(), kept);
  ASSERT_TRUE(whole);
  EXPECT_TRUE(all_valid(whole->mesh));
  EXPECT_GE(whole->after.certified.min_scaled_jacobian_lower_bound, for_accuracy().min_js - 1e-3);
  EXPECT_LT(whole->after.accuracy->loss, 5e-3);
  RunControl control;
  control.checkpoint = kept.back();
  const auto resumed = optimise(mesh, for_accuracy(), {}, control);
  ASSERT_TRUE(resumed);
  EXPECT_EQ(resumed->mesh.coordinates, whole->mesh.coordinates);
}

TEST(AccuracyObjective, SaysIfTheBoundOnTheScaledJacobianIsMissed) {
  const HighOrderMesh mesh = read_case("annulus_p3.msh");
  Options options = for_accuracy();
  for (const double min_js : {0.1, 0.95}) {
    options.min_js = min_js;
    const auto result = optimise(mesh, options);
    ASSERT_TRUE(result);
    const bool missed = result->after.min_scaled_jacobian < min_js;
    EXPECT_EQ(missed, min_js == 0.95);
    ASSERT_EQ(result->notes.size(), missed ? 1U : 0U);
    if (!missed) continue;
    EXPECT_NE(result->notes[0].find("below the 0.95 of min_js"), std::string::npos) << result->notes[0];
  }
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
  double least = 1;
  for (int rounds = 1; rounds <= 4; ++rounds) {
    const auto stopped = optimise(mesh, for_accuracy(), [rounds](const Iteration& iteration) {
      return iteration.number == rounds ? Control::Stop : Control::Continue;
    });
    ASSERT_TRUE(stopped);
    EXPECT_TRUE(all_valid(stopped->mesh));
    // A later mesh of the same rounds is taken if it is as good, because it is nearer to where they lead.
    const double loss = local_loss_of(stopped->mesh);
    EXPECT_LE(loss, threshold::kLossGivenForMinimum * least) << rounds;
    least = std::min(least, loss);
    EXPECT_LT(stopped->after.accuracy->loss, accuracy(mesh).loss) << rounds;
  }
  EXPECT_LT(least, 0.9 * local_loss_of(mesh));
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
  ASSERT_EQ(same->notes.size(), 1U);
  EXPECT_NE(same->notes[0].find("straight sides"), std::string::npos) << same->notes[0];
  const HighOrderMesh plate = read_case("cylinder_p2.msh");
  const auto kept = optimise(plate, for_accuracy());
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->mesh.coordinates, plate.coordinates);
  EXPECT_NE(kept->kept_as_it_came.find("loss of accuracy was not lower"), std::string::npos) << kept->kept_as_it_came;
}

/// A grid of hexahedra of order 2 that are a little curved.
HighOrderMesh bent_grid() {
  HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {4, 4, 4}, 2);
  testing::move_nodes(mesh, testing::bent(3, 0.02));
  return mesh;
}

// At order 2 a descent lowers the loss, but hardly the mean error of a solver, and for one solution it raises the
// error.
TEST(AccuracyObjective, LeavesMeshesOfOrderTwoWhoseErrorIsThatOfTheirSize) {
  const HighOrderMesh mesh = bent_grid();
  const auto kept = optimise(mesh, for_accuracy());
  ASSERT_TRUE(kept);
  EXPECT_GT(kept->before.accuracy->loss, 1e-3);
  EXPECT_EQ(kept->mesh.coordinates, mesh.coordinates);
  ASSERT_EQ(kept->notes.size(), 1U);
  EXPECT_NE(kept->notes[0].find("beside what their size costs"), std::string::npos) << kept->notes[0];
  HighOrderMesh wavy = bent_grid();
  testing::shake(wavy, 0.02, 3);
  ASSERT_TRUE(all_valid(wavy)) << "shake it less";
  const auto moved = optimise(wavy, for_accuracy());
  ASSERT_TRUE(moved);
  EXPECT_LT(moved->after.accuracy->loss, 0.9 * moved->before.accuracy->loss);
}

// The aerofoil comes in valid with a smallest scaled Jacobian of .08.
TEST(AccuracyObjective, BeginsWithTheEnergyOnAValidMeshBelowTheBound) {
  const HighOrderMesh mesh = read_case("aerofoil_p4.msh");
  ASSERT_TRUE(all_valid(mesh));
  const Options options = for_accuracy();
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result);
  EXPECT_NE(result->history.front().phase, Phase::Accuracy);
  EXPECT_EQ(result->history.back().phase, Phase::Accuracy);
  EXPECT_GE(result->after.certified.min_scaled_jacobian_lower_bound, options.min_js);
  EXPECT_LT(result->after.accuracy->loss, 0.5 * result->before.accuracy->loss);
}

TEST(AccuracyObjective, NeverRaisesTheLossThoughTheEnergyCameFirst) {
  const HighOrderMesh mesh = read_case("annulus_p3.msh");
  Options options = for_accuracy();
  options.min_js = 0.95;  // no mesh has it, so the energy goes to its optimum and raises the loss
  options.max_iterations = 1;
  const auto stopped = optimise(mesh, options);
  ASSERT_TRUE(stopped);
  EXPECT_LE(stopped->after.accuracy->loss, stopped->before.accuracy->loss);
}

/// Moves every coordinate by up to this, and returns the optimised mesh.
Result optimise_rounded(HighOrderMesh& mesh, double rounding) {
  testing::shake(mesh, rounding, 5);
  auto result = optimise(mesh, for_accuracy());
  EXPECT_TRUE(result);
  return std::move(*result);
}

TEST(AccuracyObjective, LowersBothTheSmallestAndTheMeanScaledJacobianOfAValidMeshOnlyAboveAHalf) {
  for (const char* name : {"annulus_p3", "solid_ball_p3"}) {
    const auto mesh = read_case(std::string(name) + ".msh");
    const auto result = optimise(mesh, for_accuracy());
    ASSERT_TRUE(result) << name;
    EXPECT_TRUE(result->after.min_scaled_jacobian >= threshold::kWanted ||
                result->after.min_scaled_jacobian >= result->before.min_scaled_jacobian - 1e-3 ||
                result->after.mean_scaled_jacobian >= result->before.mean_scaled_jacobian)
        << name;
    EXPECT_LT(result->after.accuracy->loss, 0.95 * result->before.accuracy->loss) << name;
  }
}

TEST(AccuracyObjective, LeavesMeshesAsTheyCameThatHaveNothingToGainButRounding) {
  for (const Filling filling : testing::kFillings) {
    const bool flat = filling == Filling::Triangles || filling == Filling::Quadrilaterals;
    HighOrderMesh mesh = testing::grid(filling, {3, 3, flat ? 1 : 2}, 2);
    const Result same = optimise_rounded(mesh, 1e-8);
    EXPECT_EQ(same.mesh.coordinates, mesh.coordinates) << testing::name(filling);
    EXPECT_TRUE(same.converged);
    ASSERT_EQ(same.notes.size(), 1U) << testing::name(filling);
    EXPECT_NE(same.notes[0].find("nothing was moved"), std::string::npos) << same.notes[0];
  }
  HighOrderMesh shaken = testing::grid(Filling::Triangles, {3, 3, 1}, 3);
  const Result moved = optimise_rounded(shaken, 1e-2);
  EXPECT_NE(moved.mesh.coordinates, shaken.coordinates) << "a hundredth is more than rounding";
}

TEST(DefaultObjective, IsAccuracyForCurvedElementsAndTheEnergyForStraightOnes) {
  for (const char* name : {"disc_p4.msh", "sphere_p3.msh"}) {
    const HighOrderMesh mesh = read_case(name);
    const auto usual = optimise(mesh), accurate = optimise(mesh, for_accuracy());
    ASSERT_TRUE(usual && accurate);
    EXPECT_EQ(usual->mesh.coordinates, accurate->mesh.coordinates) << name;
  }
  HighOrderMesh linear = testing::grid(Filling::Triangles, {3, 3, 1}, 1);
  testing::shake(linear, 0.2, 3);
  const auto usual = optimise(linear), energy = optimise(linear, for_energy());
  ASSERT_TRUE(usual && energy);
  EXPECT_EQ(usual->mesh.coordinates, energy->mesh.coordinates);
}

TEST(DefaultObjective, CertifiesNoFewerElementsThanTheEnergyIfSomeCannotBeRepaired) {
  for (const HighOrderMesh& mesh : {testing::six_in_a_ball(3), testing::two_in_a_ball(3)}) {
    const auto usual = optimise(mesh), energy = optimise(mesh, for_energy());
    ASSERT_TRUE(usual && energy);
    ASSERT_FALSE(energy->after.uncertified.empty()) << "make the mesh harder";
    EXPECT_LE(usual->after.uncertified.size(), energy->after.uncertified.size());
    EXPECT_LE(usual->after.accuracy->loss, energy->after.accuracy->loss);
    EXPECT_EQ(usual->history.back().phase, Phase::Accuracy);
  }
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
    EXPECT_LT(result->after.accuracy->loss, (order == 2 ? 1.001 : 0.9) * result->before.accuracy->loss)
        << "order " << order;
  }
}

}  // namespace
}  // namespace varimesh
