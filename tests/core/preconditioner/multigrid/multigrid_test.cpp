// What a cycle is as an operator, and matrices that leave it little to do.
#include "core/preconditioner/multigrid/multigrid.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "tests/core/preconditioner/multigrid/model_problems.h"

namespace varimesh {
namespace {

using testing::ModelProblem;
using testing::TestMatrix;

ModelProblem stretched_hexahedra() {
  return {{testing::equal_steps(12, 1), testing::equal_steps(13, 1), testing::boundary_layer(14, 1e-3, 1.5)}};
}

/// The solution for one set of right-hand sides.
std::vector<double> applied(Multigrid& multigrid, const std::vector<double>& right, int columns) {
  std::vector<double> solution(right.size(), std::numeric_limits<double>::quiet_NaN());
  multigrid.apply(right, solution, columns);
  return solution;
}

std::vector<double> fresh_solution(const TestMatrix& matrix, const std::vector<double>& right, int columns) {
  const Team team(1);
  Multigrid multigrid(team);
  multigrid.set_up(matrix.view());
  return applied(multigrid, right, columns);
}

TEST(Multigrid, GivesTheSameBitsForAnyNumberOfThreads) {
  const TestMatrix matrix = testing::stiffness(
      {{testing::equal_steps(60, 1), testing::equal_steps(50, 1), testing::boundary_layer(14, 1e-3, 1.5)}, true});
  const std::vector<double> right = testing::random_numbers(at(matrix.rows()) * 3);
  const std::vector<double> expected = fresh_solution(matrix, right, 3);
  for (const int threads : {2, 3}) {
    const Team team(threads);
    team.run([&] {
      Multigrid multigrid(team);
      multigrid.set_up(matrix.view());
      EXPECT_GE(multigrid.level_rows().size(), 3U);
      EXPECT_EQ(applied(multigrid, right, 3), expected) << threads << " threads";
    });
  }
}

TEST(Multigrid, TreatsColumnsAlike) {
  const TestMatrix matrix = testing::stiffness(stretched_hexahedra());
  const std::size_t rows = at(matrix.rows());
  const std::vector<double> one = testing::random_numbers(rows);
  const std::vector<double> expected = fresh_solution(matrix, one, 1);
  for (const int columns : {2, 3}) {
    std::vector<double> right(rows * at(columns));
    for (std::size_t i = 0; i < rows; ++i) right[i * at(columns) + 1] = one[i];
    const std::vector<double> solution = fresh_solution(matrix, right, columns);
    for (std::size_t i = 0; i < rows; ++i) {
      ASSERT_EQ(solution[i * at(columns)], 0);
      ASSERT_EQ(solution[i * at(columns) + 1], expected[i]);
    }
  }
}

TEST(Multigrid, IsSymmetricAndPositiveDefinite) {
  const TestMatrix matrix = testing::stiffness(
      {{testing::equal_steps(6, 1), testing::equal_steps(7, 1), testing::boundary_layer(14, 1e-2, 1.5)}});
  const int rows = matrix.rows();
  const Team team(1);
  Multigrid multigrid(team);
  multigrid.set_up(matrix.view());
  ASSERT_GE(multigrid.level_rows().size(), 2U);
  Eigen::MatrixXd V(rows, rows);
  for (int i = 0; i < rows; ++i) {
    std::vector<double> unit(at(rows));
    unit[at(i)] = 1;
    const std::vector<double> solution = applied(multigrid, unit, 1);
    V.col(i) = Eigen::Map<const Eigen::VectorXd>(solution.data(), rows);
  }
  EXPECT_LT((V - V.transpose()).norm(), 1e-13 * V.norm());
  // V is A⁻¹ but for what one cycle leaves.
  const Eigen::MatrixXd A = testing::to_eigen(matrix);
  const Eigen::MatrixXd symmetric = 0.5 * (V + V.transpose());
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(A * symmetric * A, A, Eigen::EigenvaluesOnly);
  EXPECT_GT(solver.eigenvalues().minCoeff(), 0.2);
  EXPECT_LT(solver.eigenvalues().maxCoeff(), 1.0 + 1e-6);
}

TEST(Multigrid, UpdatesToTheSameBitsWhereTheValuesAreTheSame) {
  const TestMatrix matrix = testing::stiffness(stretched_hexahedra());
  const std::vector<double> right = testing::random_numbers(at(matrix.rows()) * 3);
  const std::vector<double> expected = fresh_solution(matrix, right, 3);
  const Team team(1);
  Multigrid multigrid(team);
  multigrid.set_up(matrix.view());
  TestMatrix other = matrix;
  for (double& value : other.value) value *= 3;
  multigrid.update(other.view());
  EXPECT_NE(applied(multigrid, right, 3), expected);
  multigrid.update(matrix.view());
  EXPECT_EQ(applied(multigrid, right, 3), expected);
}

TEST(Multigrid, ScalesWithItsMatrix) {
  const TestMatrix matrix = testing::stiffness(stretched_hexahedra());
  TestMatrix other = matrix;
  for (double& value : other.value) value *= 0x1p-20;
  const std::vector<double> right = testing::random_numbers(at(matrix.rows()));
  std::vector<double> expected = fresh_solution(matrix, right, 1);
  for (double& value : expected) value *= 0x1p20;
  EXPECT_EQ(fresh_solution(other, right, 1), expected);
}

TEST(Multigrid, TakesNoRowsAndOneRow) {
  EXPECT_TRUE(fresh_solution(TestMatrix{}, {}, 3).empty());
  EXPECT_EQ(fresh_solution({{0, 1}, {0}, {4.0}}, {2, 8}, 2), (std::vector<double>{0.5, 2}));
  EXPECT_EQ(fresh_solution({{0, 0}, {}, {}}, {2}, 1), std::vector<double>{0});  // not even a diagonal entry
}

/// Squares, and after them a vertex that nothing ties to the others, one whose row is zero, and one with a pivot that
/// is no number.
TEST(Multigrid, LeavesOutWhatIsSingular) {
  const TestMatrix regular = testing::stiffness({{testing::equal_steps(20, 1), testing::equal_steps(20, 1)}});
  TestMatrix matrix = regular;
  for (const double pivot : {4.0, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    matrix.column.push_back(matrix.rows());
    matrix.value.push_back(pivot);
    matrix.row_begin.push_back(static_cast<std::int64_t>(matrix.column.size()));
  }
  std::vector<double> right = testing::random_numbers(at(regular.rows()));
  const std::vector<double> expected = fresh_solution(regular, right, 1);
  right.insert(right.end(), {8.0, 1.0, 1.0});
  const std::vector<double> solution = fresh_solution(matrix, right, 1);
  for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_NEAR(solution[i], expected[i], 1e-3 * std::abs(expected[i]));
  const std::size_t after = expected.size();
  EXPECT_NEAR(solution[after], 2, 0.25);  // smoothed twice
  EXPECT_EQ(solution[after + 1], 0);
  EXPECT_EQ(solution[after + 2], 0);
}

/// Nothing fixed: constants are in the null space.
TEST(Multigrid, StaysFiniteOnASingularMatrix) {
  TestMatrix matrix = testing::stiffness({{testing::equal_steps(30, 1), testing::equal_steps(30, 1)}});
  std::vector<double> right = testing::random_numbers(at(matrix.rows()));
  double mean = 0;
  for (std::int32_t i = 0; i < matrix.rows(); ++i) {
    double sum = 0;
    std::int64_t diagonal = 0;
    for (std::int64_t e = matrix.row_begin[at(i)]; e < matrix.row_begin[at(i) + 1]; ++e) {
      sum += matrix.value[at(e)];
      if (matrix.column[at(e)] == i) diagonal = e;
    }
    matrix.value[at(diagonal)] -= sum;
    mean += right[at(i)] / matrix.rows();
  }
  for (double& value : right) value -= mean;
  for (const double value : fresh_solution(matrix, right, 1)) ASSERT_LT(std::abs(value), 1e3);
}

}  // namespace
}  // namespace varimesh
