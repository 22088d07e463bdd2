// What a node's visit is made of beside the kernels: the Newton step, the function of J that is kept, room to work in.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/kernels/node_star.h"
#include "core/sweeps/sweep.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::make_problem;

/// H d + G of the Newton step d, over |G|: what is left of the equations.
double what_is_left(const StarExpansion& at, int d) {
  const std::array<double, 3> step = newton_step(at, d);
  double left = 0, size = 0;
  for (int i = 0; i < d; ++i) {
    double row = at.gradient[i];
    for (int j = 0; j < d; ++j) row += at.hessian[std::max(i, j) * (std::max(i, j) + 1) / 2 + std::min(i, j)] * step[j];
    left = std::max(left, std::abs(row));
    size = std::max(size, std::abs(at.gradient[i]));
  }
  return left / size;
}

TEST(NewtonStep, SolvesWhereThePivotsAreAlike) {
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
        EXPECT_LE(what_is_left(at, d), 1e-13);
      }
}

TEST(NewtonStep, GoesDownWhereTheHessianDoesNot) {
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

TEST(KeptFunction, IsTakenAnewWhereNoStepIsAccepted) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 3, testing::bent(3));
  testing::shake(mesh, 0.01, 7);
  Problem problem = make_problem(mesh);
  const auto kernels = make_kernels(material(Options{}), 3);
  const ColouredNodes coloured = colour_nodes(problem, Colouring::Group);
  const Team team(1);
  Sweeper sweeper(problem, coloured, *kernels, Regularisation::Element, PNorm{}, -1, team);
  sweeper.rebuild();
  ASSERT_EQ(sweeper.scan().invalid, 0);
  // All stars look better than any step can make them: the energy falls with ln J up to μ/λ.
  for (CellSet& block : problem.sets)
    for (double& number : block.jacobian_function) number = 0.1;
  sweeper.sweep();
  for (const Incidence& at : problem.incidences) {
    const CellSet& block = problem.sets[at.set];
    AlignedVector<double> expected(block.stride);
    kernels->take_function(block.deformation_of(at.cell), block.stride, expected.data());
    for (int q = 0; q < block.stride; ++q) EXPECT_NEAR(block.jacobian_function_of(at.cell)[q], expected[q], 1e-12);
  }
}

TEST(KeptFunction, IsToBeTakenWhereThereIsNewRoomForIt) {
  Problem problem = make_problem(testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2));
  EXPECT_TRUE(hold_deformation(problem, false));
  EXPECT_FALSE(hold_deformation(problem, false));
  EXPECT_TRUE(hold_deformation(problem, true));
  EXPECT_FALSE(hold_deformation(problem, true));
  EXPECT_FALSE(hold_deformation(problem, false));
  EXPECT_TRUE(problem.sets[0].jacobian_function.empty());
}

TEST(Patches, GiveCellsRoomWhileThereIsSome) {
  Problem problem = make_problem(testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2));
  AlignedVector<double> scratch(NodeStar::kMostNumbers);
  const int stride = problem.sets[0].stride, line_size = static_cast<int>(NodeStar::kMostNumbers) / stride / 3;
  for (std::int32_t rank = 0; rank < std::int32_t(problem.free.size()); ++rank) {
    NodeStar star(problem, rank, line_size, scratch.data());
    for (std::size_t i = 0; i < star.cells().size(); ++i) {
      double* const expected = i < 3 ? scratch.data() + i * line_size * stride : nullptr;
      EXPECT_EQ(star.cells()[i].line, expected);
    }
  }
}

}  // namespace
}  // namespace varimesh
