// Iterations of conjugate gradients with one cycle as the preconditioner, over sizes, shapes and coefficients.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>

#include "core/preconditioner/multigrid/multigrid.h"
#include "tests/core/preconditioner/multigrid/model_problems.h"

namespace varimesh {
namespace {

using testing::boundary_layer;
using testing::equal_steps;
using testing::ModelProblem;
using testing::TestMatrix;

/// Iterations until the residual, in the preconditioner's norm, is 1e-6 of the first.
int iterations(const ModelProblem& problem) {
  const TestMatrix matrix = testing::stiffness(problem);
  const testing::RowMajor A = testing::to_eigen(matrix);
  const Team team(1);
  Multigrid multigrid(team);
  multigrid.set_up(matrix.view());
  const std::vector<double> right = testing::random_numbers(at(matrix.rows()));
  Eigen::VectorXd r = Eigen::Map<const Eigen::VectorXd>(right.data(), A.rows());
  Eigen::VectorXd z(A.rows()), p = Eigen::VectorXd::Zero(A.rows());
  double rz = 0, first = 0;
  for (int iteration = 0; iteration < 100; ++iteration) {
    multigrid.apply({r.data(), right.size()}, {z.data(), right.size()}, 1);
    const double before = rz;
    rz = r.dot(z);
    if (iteration == 0) first = rz;
    if (!(rz >= 0)) return -1;  // not positive definite
    if (rz <= 1e-12 * first) return iteration;
    p = z + (iteration == 0 ? 0 : rz / before) * p;
    const Eigen::VectorXd product = A * p;
    r -= rz / p.dot(product) * product;
  }
  return 100;
}

void expect_between(const ModelProblem& problem, int least, int most) {
  const int count = iterations(problem);
  EXPECT_GE(count, least);
  EXPECT_LE(count, most);
}

TEST(MultigridConvergence, DoesNotDependOnTheSizeOfAGrid) {
  for (const int n : {32, 100, 250})
    for (const bool is_simplicial : {false, true})
      expect_between({{equal_steps(n, 1), equal_steps(n, 1)}, is_simplicial}, 3, 12);
  for (const int n : {10, 20, 32})
    for (const bool is_simplicial : {false, true})
      expect_between({{equal_steps(n, 1), equal_steps(n, 1), equal_steps(n, 1)}, is_simplicial}, 3, 9);
}

TEST(MultigridConvergence, DoesNotDependOnHowFarAGridIsStretched) {
  for (const double stretch : {2.0, 3.0, 10.0, 100.0, 1000.0})
    for (const bool is_simplicial : {false, true}) {
      expect_between({{equal_steps(100, stretch), equal_steps(100, 1)}, is_simplicial}, 3, 15);
      expect_between({{equal_steps(20, stretch), equal_steps(20, 1), equal_steps(20, 1)}, is_simplicial}, 3, 15);
      expect_between({{equal_steps(20, stretch), equal_steps(20, stretch), equal_steps(20, 1)}, is_simplicial}, 3, 17);
    }
}

TEST(MultigridConvergence, TakesBoundaryLayers) {
  for (const bool is_simplicial : {false, true}) {
    expect_between({{equal_steps(100, 1), boundary_layer(100, 1e-3, 1.3)}, is_simplicial}, 3, 13);
    expect_between({{equal_steps(24, 1), equal_steps(24, 1), boundary_layer(40, 1e-3, 1.3)}, is_simplicial}, 3, 15);
  }
}

TEST(MultigridConvergence, TakesCoefficientsThatJump) {
  for (const bool is_simplicial : {false, true}) {
    ModelProblem plane{{equal_steps(100, 1), equal_steps(100, 1)}, is_simplicial};
    plane.coefficient = [](const std::array<int, 3>& cell) {
      return std::pow(10.0, 3 * ((cell[0] / 5 + cell[1] / 5) % 3));
    };
    expect_between(plane, 3, 15);
    ModelProblem space{{equal_steps(24, 1), equal_steps(24, 1), equal_steps(24, 1)}, is_simplicial};
    space.coefficient = [](const std::array<int, 3>& cell) {
      return std::pow(10.0, 3 * ((cell[0] / 5 + cell[1] / 5 + cell[2] / 5) % 3));
    };
    expect_between(space, 3, 10);
  }
}

TEST(MultigridConvergence, IsTheSameForAMillionVertices) {
  if (std::getenv("VARIMESH_LONG_TESTS") == nullptr) GTEST_SKIP() << "NOT RUN: long; set VARIMESH_LONG_TESTS=1";
  for (const bool is_simplicial : {false, true}) {
    expect_between({{equal_steps(1000, 1), equal_steps(1000, 1)}, is_simplicial}, 3, 14);
    expect_between({{equal_steps(100, 1), equal_steps(100, 1), equal_steps(100, 1)}, is_simplicial}, 3, 11);
  }
}

}  // namespace
}  // namespace varimesh
