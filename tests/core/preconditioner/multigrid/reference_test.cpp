// Multigrid against a plain implementation with dense matrices, in double precision.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/random/hash.h"
#include "core/preconditioner/multigrid/aggregation.h"
#include "core/preconditioner/multigrid/multigrid.h"
#include "tests/core/preconditioner/multigrid/model_problems.h"

namespace varimesh {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::ModelProblem;
using testing::TestMatrix;

constexpr double kThreshold = 0.4, kDamping = 2.0 / 3, kRatio = 6;
constexpr int kMostDense = 256;

TestMatrix to_sparse(const MatrixXd& matrix) { return testing::to_test_matrix(matrix.sparseView()); }

/// The largest −a_ik of each row.
VectorXd strongest(const MatrixXd& A) {
  MatrixXd off = -A;
  off.diagonal().setZero();
  return off.rowwise().maxCoeff();
}

bool is_alone(const MatrixXd& A, int i) { return A.row(i).cwiseAbs().sum() <= 1.1 * A(i, i); }

MatrixXd strong_connections(const MatrixXd& A) {
  VectorXd most = strongest(A);
  for (int i = 0; i < A.rows(); ++i)
    if (is_alone(A, i)) most[i] = std::numeric_limits<double>::infinity();
  MatrixXd strong = MatrixXd::Zero(A.rows(), A.cols());
  for (int i = 0; i < A.rows(); ++i)
    for (int j = 0; j < A.cols(); ++j)
      if (i != j && A(i, j) < 0 && -A(i, j) >= kThreshold * std::sqrt(most[i] * most[j])) strong(i, j) = 1;
  for (int i = 0; i < A.rows(); ++i)
    if (strong.row(i).isZero())
      for (int j = 0; j < A.cols(); ++j)
        if (i != j && -A(i, j) >= kThreshold * most[i]) strong(i, j) = 1;
  return strong;
}

bool is_mutual(const MatrixXd& strong, int i, int j) { return strong(i, j) > 0 && strong(j, i) > 0; }

/// One row after another, in the order of the hashes: no rounds.
std::vector<int> aggregates(const MatrixXd& A, const MatrixXd& strong) {
  const int rows = static_cast<int>(A.rows());
  std::vector<int> order(rows);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [](int a, int b) { return hash(static_cast<std::uint32_t>(a)) > hash(static_cast<std::uint32_t>(b)); });
  const auto neighbours = [&](int i) {
    std::vector<int> out;
    for (int j = 0; j < rows; ++j)
      if (is_mutual(strong, i, j)) out.push_back(j);
    return out;
  };
  std::vector<char> is_root(rows), is_near(rows);  // near: within two connections of a root
  for (const int i : order) {
    if (is_near[i] || neighbours(i).empty()) continue;
    is_root[i] = 1;
    for (const int j : neighbours(i)) {
      is_near[j] = 1;
      for (const int k : neighbours(j)) is_near[k] = 1;
    }
  }
  std::vector<int> core(rows, -1);
  int count = 0;
  for (int i = 0; i < rows; ++i)
    if (is_root[i]) core[i] = count++;
  for (int i = 0; i < rows; ++i)
    if (is_root[i])
      for (const int j : neighbours(i)) core[j] = core[i];
  std::vector<int> out = core;
  for (int i = 0; i < rows; ++i)
    if (core[i] < 0) {
      double best = 0;
      for (int j = 0; j < rows; ++j)
        if (strong(i, j) > 0 && core[j] >= 0 && -A(i, j) > best) {
          best = -A(i, j);
          out[i] = core[j];
        }
    }
  return out;
}

MatrixXd smoothed_prolongator(const MatrixXd& A) {
  const MatrixXd strong = strong_connections(A);
  const std::vector<int> of_row = aggregates(A, strong);
  MatrixXd T = MatrixXd::Zero(A.rows(), *std::max_element(of_row.begin(), of_row.end()) + 1);
  for (int i = 0; i < A.rows(); ++i)
    if (of_row[i] >= 0) T(i, of_row[i]) = 1;
  const MatrixXd filtered = A.cwiseProduct(strong);  // off the diagonal
  VectorXd diagonal = -filtered.rowwise().sum() + A.rowwise().sum().cwiseMax(0);
  const MatrixXd A_F = filtered + MatrixXd(diagonal.asDiagonal());
  for (int i = 0; i < A.rows(); ++i)
    if (is_alone(A, i)) diagonal[i] = 1;
  VectorXd damping = VectorXd::Constant(A.rows(), kDamping);
  for (int i = 0; i < A.rows(); ++i)
    if (of_row[i] < 0) damping[i] = 1;
  return T - damping.cwiseQuotient(diagonal).asDiagonal() * (A_F * T);
}

/// x after two Chebyshev steps on A x = b: the minimax polynomial on [largest / ratio, largest] that is 1 at 0.
MatrixXd smoothed(const MatrixXd& A, const MatrixXd& b, const MatrixXd& x, double largest) {
  // 1 − λq(λ) = T₂(s − tλ) / T₂(s) with T₂(y) = 2y² − 1, s = (ratio + 1) / (ratio − 1).
  const double smallest = largest / kRatio;
  const double s = (largest + smallest) / (largest - smallest), t = 2 / (largest - smallest);
  const MatrixXd z = A.diagonal().cwiseInverse().asDiagonal() * (b - A * x);
  const MatrixXd again = A.diagonal().cwiseInverse().asDiagonal() * (A * z);
  return x + (4 * s * t * z - 2 * t * t * again) / (2 * s * s - 1);
}

MatrixXd cycle(const MatrixXd& A, const MatrixXd& b, int& levels) {
  ++levels;
  if (A.rows() <= kMostDense) return A.llt().solve(b);
  const Team team(1);
  const double largest = multigrid::largest_eigenvalue(team, multigrid::level_matrix(team, to_sparse(A).view()));
  MatrixXd x = smoothed(A, b, MatrixXd::Zero(b.rows(), b.cols()), largest);
  const MatrixXd P = smoothed_prolongator(A);
  x += P * cycle(P.transpose() * A * P, P.transpose() * (b - A * x), levels);
  return smoothed(A, b, x, largest);
}

void expect_as_reference(const ModelProblem& problem, int expected_levels) {
  const TestMatrix matrix = testing::stiffness(problem);
  const Team team(1);
  Multigrid multigrid(team);
  multigrid.set_up(matrix.view());
  const auto rows = static_cast<std::size_t>(matrix.rows());
  const std::vector<double> right = testing::random_numbers(rows * 2);
  std::vector<double> solution(rows * 2);
  multigrid.apply(right, solution, 2);
  using TwoColumns = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
  const auto count = static_cast<Eigen::Index>(rows);
  int levels = 0;
  const MatrixXd expected =
      cycle(testing::to_eigen(matrix), Eigen::Map<const TwoColumns>(right.data(), count, 2), levels);
  EXPECT_EQ(levels, expected_levels);
  EXPECT_EQ(multigrid.level_rows().size(), std::size_t(levels));
  const double difference = (Eigen::Map<const TwoColumns>(solution.data(), count, 2) - expected).norm();
  EXPECT_LT(difference, 1e-6 * expected.norm());
}

/// Differs from cell to cell, so that no two connections are equally strong: rounding would decide between them.
double uneven(const std::array<int, 3>& cell) {
  const int number = cell[0] + 100 * (cell[1] + 100 * cell[2]);
  return 1 + hash(static_cast<std::uint32_t>(number)) / 4294967296.0;
}

TEST(MultigridCycle, IsTheReferenceOnSquares) {
  expect_as_reference({{testing::equal_steps(20, 1), testing::equal_steps(25, 1)}, false, uneven}, 2);
}

TEST(MultigridCycle, IsTheReferenceOnStretchedTriangles) {
  expect_as_reference({{testing::equal_steps(30, 1000), testing::equal_steps(35, 1)}, true, uneven}, 3);
}

TEST(MultigridCycle, IsTheReferenceOnABoundaryLayerOfHexahedra) {
  const std::vector<double> layer = testing::boundary_layer(13, 1e-3, 1.7);
  expect_as_reference({{testing::equal_steps(9, 1), testing::equal_steps(9, 1), layer}, false, uneven}, 3);
}

TEST(MultigridCycle, IsTheReferenceWithSoftAndStiffParts) {
  const auto coefficient = [](const std::array<int, 3>& cell) {
    return uneven(cell) * ((cell[0] / 3 + cell[1] / 3) % 2 == 0 ? 1 : 1e4);
  };
  expect_as_reference({{testing::equal_steps(30, 1), testing::equal_steps(32, 1)}, false, coefficient}, 2);
}

TEST(MultigridEigenvalue, IsBetweenTheLargestAndATenthMore) {
  const Team team(1);
  for (const double stretch : {1.0, 30.0, 1000.0})
    for (const bool is_simplicial : {false, true}) {
      const TestMatrix matrix = testing::stiffness(
          {{testing::equal_steps(7, stretch), testing::equal_steps(8, 1), testing::equal_steps(9, 1)}, is_simplicial});
      const double estimate = multigrid::largest_eigenvalue(team, multigrid::level_matrix(team, matrix.view()));
      const MatrixXd A = testing::to_eigen(matrix);
      const MatrixXd D = A.diagonal().asDiagonal();
      const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(A, D, Eigen::EigenvaluesOnly);
      EXPECT_GE(estimate, solver.eigenvalues().maxCoeff());
      EXPECT_LE(estimate, solver.eigenvalues().maxCoeff() * 1.11);
    }
}

}  // namespace
}  // namespace varimesh
