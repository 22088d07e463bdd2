// Newton steps have the plain kernels' gradient, converge fast, and never raise the energy or spoil a cell.
#include "core/solvers/newton/newton.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "core/kernels/node_star.h"
#include "core/optimise/optimiser.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class NewtonOn : public ::testing::TestWithParam<Filling> {
 protected:
  void prepare(double shake, PNorm norm = {}, int threads = 1) {
    HighOrderMesh mesh = testing::grid(GetParam(), {3, 3, 2}, 3, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh, shake, 7);
    problem_ = testing::make_problem(mesh);
    norm_ = norm;
    const Material material = varimesh::material(Options{});
    kernels_ = make_kernels(material, problem_.dimension);
    hessian_ = make_hessian_kernels(material, problem_.dimension);
    team_.set_threads(threads);
    sweeper_.emplace(problem_, schedule_, *kernels_, Regularisation::Element, norm, -1.0, team_);
    sweeper_->rebuild();
    seen_ = sweeper_->scan();
    drop_deformation(problem_);
    newton_.emplace(problem_, *kernels_, *hessian_, norm, 1e-8, team_);
  }

  NewtonOutcome step() {
    const NewtonOutcome outcome = newton_->step();
    sweeper_->changed(newton_->scans());
    seen_ = sweeper_->scan();
    return outcome;
  }

  /// √ Σ |G|² by the plain kernels, node by node.
  double plain_gradient_norm() {
    const auto plain = make_plain_kernels(material(Options{}), problem_.dimension);
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) plain->rebuild(set, cell, problem_.positions);
    double sum = 0;
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank)
      for (const double g : expand(*plain, NodeStar(problem_, rank).cells(), norm_).gradient) sum += g * g;
    drop_deformation(problem_);
    return std::sqrt(sum);
  }

  Problem problem_;
  PNorm norm_;
  ColouredNodes schedule_;
  Team team_{1};
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  std::optional<Sweeper> sweeper_;
  std::optional<Newton> newton_;
  ScanOutcome seen_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, NewtonOn, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(NewtonOn, LeavesTheNodesWhereTheyWereIfItIsInterrupted) {
  prepare(0.05);
  const std::vector<double> start = problem_.positions;
  std::int64_t whole = 0;
  const StopToken counter([&] { return ++whole < 0; });
  team_.set_stop(&counter);
  newton_->step();
  ASSERT_GT(whole, 30);
  for (std::int64_t looks = 1; looks <= whole; looks += 1 + whole / 37) {
    team_.set_stop(nullptr);
    prepare(0.05);
    std::int64_t looked = 0;
    const StopToken token([&] { return ++looked == looks; });
    team_.set_stop(&token);
    EXPECT_THROW(newton_->step(), Interrupted) << "look " << looks << " of " << whole;
    EXPECT_EQ(problem_.positions, start) << "look " << looks << " of " << whole;
  }
  team_.set_stop(nullptr);
}

TEST_P(NewtonOn, HasTheGradientOfThePlainKernels) {
  for (const double shake : {0.01, 0.12})
    for (const double p : {1.0, 3.0}) {
      prepare(shake, PNorm{p});
      const double expected = plain_gradient_norm();
      EXPECT_NEAR(step().gradient_norm, expected, 1e-8 * expected) << "p " << p;
    }
}

TEST_P(NewtonOn, ConvergesInFewSteps) {
  prepare(0.01);
  NewtonOutcome outcome;
  int steps = 0;
  do {
    outcome = step();
    ++steps;
    EXPECT_LE(outcome.products, Newton::kMostProducts);
  } while (!outcome.converged && steps < 20);
  EXPECT_LT(steps, 12);
  EXPECT_FALSE(outcome.failed);
  EXPECT_EQ(outcome.linear_solve, LinearSolve::Solved);
  EXPECT_LE(outcome.residual, 1e-8);
  EXPECT_LT(plain_gradient_norm(), 1e-7);
}

TEST_P(NewtonOn, MeasuresTheResidualByTheCells) {
  prepare(0.0005);
  const std::vector<double> before = problem_.positions;
  const NewtonOutcome outcome = step();
  ASSERT_EQ(outcome.damping, 1);
  const auto d = std::size_t(problem_.dimension);
  double most = 0;
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank) {
    float size = std::numeric_limits<float>::infinity();
    for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
      const Incidence& at = problem_.incidences[std::size_t(i)];
      size = std::min(size, problem_.cell_size[std::size_t(problem_.sets[std::size_t(at.set)].first + at.cell)]);
    }
    double square = 0;
    for (std::size_t k = 0; k < d; ++k)
      square += std::pow(problem_.positions[std::size_t(problem_.free[rank]) * d + k] -
                             before[std::size_t(problem_.free[rank]) * d + k],
                         2);
    most = std::max(most, std::sqrt(square) / size);
  }
  EXPECT_NEAR(outcome.residual, most, 1e-6 * most);
}

TEST_P(NewtonOn, LowersTheEnergyAndKeepsValidCellsValid) {
  prepare(0.005);
  ASSERT_EQ(seen_.invalid, 0);
  for (int i = 0; i < 4; ++i) {
    const double before = seen_.energy;
    const NewtonOutcome outcome = step();
    EXPECT_GT(outcome.damping, 0);
    EXPECT_GT(outcome.products, 0);
    EXPECT_LT(seen_.energy, before);
    EXPECT_EQ(seen_.invalid, 0);
  }
}

TEST_P(NewtonOn, MakesNoMoreCellsInvalidIfSomeAre) {
  prepare(0.12);
  ASSERT_GT(seen_.invalid, 0);
  for (int i = 0; i < 4; ++i) {
    const std::int64_t before = seen_.invalid;
    step();
    EXPECT_LE(seen_.invalid, before);
  }
}

TEST_P(NewtonOn, StaysAtTheOptimum) {
  // A straight-sided mesh is its own target, so there is nothing to do.
  problem_ = testing::make_problem(testing::grid(GetParam(), {3, 3, 2}, 2));
  const std::vector<double> before = problem_.positions;
  kernels_ = make_kernels(material(Options{}), problem_.dimension);
  hessian_ = make_hessian_kernels(material(Options{}), problem_.dimension);
  newton_.emplace(problem_, *kernels_, *hessian_, PNorm{}, 1e-9, team_);
  EXPECT_LT(newton_->step().residual, 1e-12);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(problem_.positions[i], before[i], 1e-12);
}

TEST_P(NewtonOn, LeavesScansOfTheMeshAsItIs) {
  prepare(0.02);
  newton_->step();
  AlignedVector<double> deformation;
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      deformation.resize(set.deformation_size());
      kernels_->deform(set, cell, problem_.positions, deformation.data());
      const CellScan expected = kernels_->scan(set, cell, deformation.data(), nullptr);
      EXPECT_EQ(newton_->scans()[std::size_t(set.first + cell)].energy, expected.energy);
      EXPECT_EQ(newton_->scans()[std::size_t(set.first + cell)].smallest_jacobian, expected.smallest_jacobian);
    }
}

TEST_P(NewtonOn, GivesTheSameBitsOnAnyNumberOfThreads) {
  std::vector<double> alone;
  for (const int threads : {1, 3}) {
    prepare(0.02, {}, threads);
    team_.run([&] {
      for (int i = 0; i < 3; ++i) step();
    });
    if (threads == 1) alone = problem_.positions;
  }
  EXPECT_EQ(problem_.positions, alone);
}

TEST(NewtonOnTheCircle, NeedsFewProductsPerStep) {
  Options options;
  options.constants = Constants::Reference;
  const auto result = optimise(testing::read_case("circle_p5.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  ASSERT_TRUE(result->converged);
  int steps = 0, products = 0;
  for (const Iteration& iteration : result->history) {
    steps += iteration.phase == Phase::Newton ? 1 : 0;
    products += iteration.products;
  }
  ASSERT_GT(steps, 0);
  // With the node blocks only, without a coarse level, it takes 60 and more.
  EXPECT_LT(products, 30 * steps);
}

}  // namespace
}  // namespace varimesh
