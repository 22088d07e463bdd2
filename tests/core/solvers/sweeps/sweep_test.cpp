// A sweep: the Newton step of a node, who is visited, what a scan sees, and that no energy rises.
#include "core/solvers/sweeps/sweep.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <random>

#include "core/base/index.h"
#include "core/kernels/node_star.h"
#include "core/kernels/regularisation.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::make_problem;

// === The step of one node ================================================================================

/// H d + G for the Newton step d, relative to |G|: the residual of the equations.
double relative_residual(const StarExpansion& at, int d) {
  const std::array<double, 3> step = newton_step(at, d);
  double left = 0, size = 0;
  for (int i = 0; i < d; ++i) {
    double row = at.gradient[i];
    for (int j = 0; j < d; ++j) row += at.hessian[symmetric_index(i, j)] * step[j];
    left = std::max(left, std::abs(row));
    size = std::max(size, std::abs(at.gradient[i]));
  }
  return left / size;
}

TEST(NewtonStep, SolvesTheEquationsIfThePivotsAreAlike) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const int d : {2, 3})
    for (const double scale : {1e-20, 1.0, 1e20})
      for (int sample = 0; sample < 200; ++sample) {
        StarExpansion at;
        for (int i = 0, entry = 0; i < d; ++i) {
          at.gradient[i] = scale * uniform(random);
          for (int j = 0; j <= i; ++j, ++entry) at.hessian[entry] = scale * (0.3 * uniform(random) + (i == j ? 1 : 0));
        }
        EXPECT_LE(relative_residual(at, d), 1e-13);
      }
}

TEST(NewtonStep, GoesDownIfTheHessianIsNotPositive) {
  // Diagonal matrices: the step is −G/|h|, with |h| no less than a thousandth of the largest.
  for (const double h : {-1.0, -1e-6, 0.0, 1e-6, 0.0024, 0.0026, 1.0})
    for (const int at : {0, 1, 2}) {
      StarExpansion expansion;
      expansion.gradient = {1, 1, 1};
      expansion.hessian = {1, 0, 1, 0, 0, 1};
      expansion.hessian[std::array{0, 2, 5}[at]] = h;
      for (const int d : {2, 3}) {
        if (at >= d) continue;
        const std::array<double, 3> step = newton_step(expansion, d);
        for (int i = 0; i < d; ++i)
          EXPECT_NEAR(step[i], i == at ? -1 / std::max(std::abs(h), 1e-3) : -1.0, 1e-9) << h << " at " << at;
      }
    }
}

TEST(NewtonStep, IsFiniteWhateverTheNumbers) {
  for (const double number : {1e-200, 1e200, std::numeric_limits<double>::infinity(), std::nan("")})
    for (int entry = 0; entry < 6; ++entry) {
      StarExpansion at;
      at.gradient = {1, -2, 3};
      at.hessian = {2, 0.1, 1, 0.2, 0.3, 3};
      at.hessian[entry] = number;
      for (const int d : {2, 3})
        for (const double component : newton_step(at, d)) EXPECT_TRUE(std::isfinite(component)) << number;
    }
}

// === Sweeps ==============================================================================================

TEST(KeptFunction, IsComputedAnewIfNoStepIsAccepted) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 3, testing::bent(3));
  testing::shake(mesh, 0.01, 7);
  Problem problem = make_problem(mesh);
  const auto kernels = make_kernels(material(Options{}), 3);
  const ColouredNodes schedule = colour_nodes(problem, Colouring::Group);
  const Team team(1);
  Sweeper sweeper(problem, schedule, *kernels, Regularisation::Element, PNorm{}, -1, team);
  sweeper.rebuild();
  ASSERT_EQ(sweeper.scan().invalid, 0);
  // With these values every star looks better than any step can make it: the energy falls with ln J up to μ/λ.
  for (CellSet& set : problem.sets)
    for (double& number : set.jacobian_function) number = 0.1;
  sweeper.sweep();
  for (const Incidence& at : problem.incidences) {
    const CellSet& set = problem.sets[at.set];
    AlignedVector<double> expected(set.stride);
    kernels->take_function(set.deformation_of(at.cell), set.stride, expected.data());
    for (int q = 0; q < set.stride; ++q) EXPECT_NEAR(set.jacobian_function_of(at.cell)[q], expected[q], 1e-12);
  }
}

/// A sweeper on a mesh, with the deformation gradients in place.
class SweeperTest : public ::testing::TestWithParam<Filling> {
 protected:
  void prepare(double shake, double rest = -1, PNorm norm = {}, int threads = 1) {
    mesh_ = testing::grid(GetParam(), {3, 3, 2}, 3, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh_, shake, 7);
    problem_ = make_problem(mesh_);
    kernels_ = make_kernels(material(Options{}), problem_.dimension);
    schedule_ = colour_nodes(problem_, Colouring::Group);
    team_.set_threads(threads);
    sweeper_.emplace(problem_, schedule_, *kernels_, Regularisation::Element, norm, rest, team_);
    sweeper_->rebuild();
    seen_ = sweeper_->scan();
  }

  HighOrderMesh mesh_;
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  ColouredNodes schedule_;
  Team team_{1};
  std::optional<Sweeper> sweeper_;
  ScanOutcome seen_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, SweeperTest, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(SweeperTest, ScansTheEnergyAndTheInvalidCellsLikeThePlainKernels) {
  for (const double shake : {0.01, 0.15}) {
    prepare(shake);
    const auto plain = make_plain_kernels(material(Options{}), problem_.dimension);
    double energy = 0, measure = 0, least = 1;
    std::int64_t invalid = 0;
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const CellScan scan = plain->scan_kept(set, cell);
        energy += scan.energy;
        measure += cell_measure(set, cell);
        least = std::min(least, scan.scaled_jacobian);
        invalid += scan.smallest_jacobian > 0 ? 0 : 1;
        EXPECT_EQ(set.delta_squared[std::size_t(cell)] > 0, !(scan.smallest_jacobian > 0));
      }
    EXPECT_EQ(invalid > 0, shake > 0.1);
    EXPECT_EQ(seen_.invalid, invalid);
    EXPECT_NEAR(seen_.energy, energy / measure, 1e-10 * std::abs(energy / measure));
    EXPECT_NEAR(seen_.min_scaled_jacobian, least, 1e-11);
  }
}

TEST_P(SweeperTest, ScansThePNormOfTheCellsMeans) {
  prepare(0.01, -1, PNorm{3});
  double sum = 0, measure = 0;
  for (CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const double volume = cell_measure(set, cell);
      sum += volume * std::pow(kernels_->scan_kept(set, cell).energy / volume, 3);
      measure += volume;
    }
  EXPECT_NEAR(seen_.energy, std::cbrt(sum / measure), 1e-12 * seen_.energy);
}

TEST_P(SweeperTest, LowersTheEnergyAndKeepsValidCellsValid) {
  for (const double p : {1.0, 2.0}) {
    prepare(0.01, -1, PNorm{p});
    ASSERT_EQ(seen_.invalid, 0);
    double last = seen_.energy;
    for (int sweep = 0; sweep < 5; ++sweep) {
      const SweepOutcome outcome = sweeper_->sweep();
      EXPECT_EQ(outcome.visited, std::int64_t(problem_.free.size()));
      EXPECT_GT(outcome.residual, 0);
      const ScanOutcome now = sweeper_->scan();
      EXPECT_LT(now.energy, last);
      EXPECT_EQ(now.invalid, 0);
      last = now.energy;
    }
  }
}

TEST_P(SweeperTest, KeepsTheDeformationGradientsOfThePositions) {
  prepare(0.02);
  for (int sweep = 0; sweep < 3; ++sweep) {
    sweeper_->sweep();
    sweeper_->scan();
  }
  AlignedVector<double> expected;
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      expected.resize(set.deformation_size());
      kernels_->deform(set, cell, problem_.positions, expected.data());
      for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(set.deformation_of(cell)[i], expected[i], 1e-12);
    }
}

TEST_P(SweeperTest, MovesFreeNodesOnly) {
  prepare(0.02);
  const std::vector<double> before = problem_.positions;
  sweeper_->sweep();
  const std::vector<bool> fixed = fixed_nodes(mesh_);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const bool same = problem_.positions[i] == before[i];
    EXPECT_TRUE(same || !fixed[i / std::size_t(problem_.dimension)]);
    moved += same ? 0 : 1;
  }
  EXPECT_GT(moved, problem_.free.size() / 2);
}

TEST_P(SweeperTest, PassesOverNodesWhoseCellsAreAtRest) {
  prepare(0.01, 1e-5);
  const auto all = std::int64_t(problem_.free.size());
  EXPECT_EQ(sweeper_->sweep().visited, all) << "at first every node is awake";
  std::int64_t visited = all;
  for (int sweep = 0; sweep < 1000 && visited > 0; ++sweep) {
    sweeper_->scan();
    visited = sweeper_->sweep().visited;
  }
  EXPECT_EQ(visited, 0) << "in the end no node is awake";
  sweeper_->wake();
  const SweepOutcome outcome = sweeper_->sweep();
  EXPECT_EQ(outcome.visited, all);
  EXPECT_LT(outcome.residual, 1e-3) << "the mesh should be at its optimum already";
}

TEST_P(SweeperTest, DoesNotDependOnTheNumberOfThreads) {
  std::vector<double> alone;
  for (const int threads : {1, 3}) {
    prepare(0.02, 1e-6, {}, threads);
    team_.run([&] {
      for (int sweep = 0; sweep < 4; ++sweep) {
        sweeper_->sweep();
        sweeper_->scan();
      }
    });
    if (threads == 1) alone = problem_.positions;
  }
  EXPECT_EQ(problem_.positions, alone);
}

TEST_P(SweeperTest, LeavesUnrepairableCellsAMildEnergy) {
  prepare(0.01);
  for (CellSet& set : problem_.sets) set.unrepairable.assign(std::size_t(set.count), 1);
  sweeper_->scan();
  for (const CellSet& set : problem_.sets)
    for (const double delta_squared : set.delta_squared) EXPECT_EQ(delta_squared, kUnrepairableDeltaSquared);
  for (CellSet& set : problem_.sets) set.unrepairable.clear();
  sweeper_->scan();
  for (const CellSet& set : problem_.sets)
    for (const double delta_squared : set.delta_squared) EXPECT_EQ(delta_squared, 0) << "valid cells need no δ";
}

}  // namespace
}  // namespace varimesh
