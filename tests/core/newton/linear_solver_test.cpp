// The order-1 problem by multigrid against the same problem by a sparse factor.
#include "core/newton/linear_solver.h"

#include <gtest/gtest.h>

#include "tests/core/multigrid/model_problems.h"

namespace varimesh {
namespace {

LinearSolver::Matrix lower_triangle() {
  const testing::TestMatrix matrix = testing::stiffness(
      {{testing::equal_steps(12, 1), testing::equal_steps(13, 1), testing::boundary_layer(14, 1e-3, 1.5)}});
  return LinearSolver::Matrix(testing::to_eigen(matrix)).triangularView<Eigen::Lower>();
}

Eigen::MatrixXd right_side(Eigen::Index rows) {
  const std::vector<double> numbers = testing::random_numbers(static_cast<std::size_t>(rows) * 3);
  return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), rows, 3);
}

Eigen::MatrixXd solution(const LinearSolver::Matrix& lower, const Team& team, std::int32_t most_factored) {
  LinearSolver solver(team, most_factored);
  solver.analyse(lower);
  EXPECT_TRUE(solver.factorise(lower));
  Eigen::MatrixXd out;
  solver.solve(right_side(lower.rows()), out);
  return out;
}

TEST(LinearSolver, SolvesExactlyUpToTheLimit) {
  const LinearSolver::Matrix lower = lower_triangle();
  const auto vertices = static_cast<std::int32_t>(lower.rows());
  const Eigen::MatrixXd x = solution(lower, Team(1), vertices);
  const Eigen::MatrixXd product = lower.selfadjointView<Eigen::Lower>() * x;
  EXPECT_LT((product - right_side(vertices)).norm(), 1e-10 * product.norm());
}

TEST(LinearSolver, ComesCloseAboveTheLimit) {
  const LinearSolver::Matrix lower = lower_triangle();
  const auto vertices = static_cast<std::int32_t>(lower.rows());
  const Eigen::MatrixXd exact = solution(lower, Team(1), vertices);
  const Eigen::MatrixXd x = solution(lower, Team(1), vertices - 1);
  const auto energy = [&](const Eigen::MatrixXd& v) {
    const Eigen::MatrixXd product = lower.selfadjointView<Eigen::Lower>() * v;
    return v.cwiseProduct(product).sum();
  };
  EXPECT_GT(energy(x - exact), 1e-9 * energy(exact));  // not by the factor
  EXPECT_LT(energy(x - exact), 0.64 * energy(exact));
}

TEST(LinearSolver, GivesTheSameBitsForAnyNumberOfThreads) {
  const LinearSolver::Matrix lower = lower_triangle();
  for (const std::int32_t most : {std::int32_t{1} << 30, 0}) {
    const Eigen::MatrixXd expected = solution(lower, Team(1), most);
    for (const int threads : {2, 3}) {
      const Team team(threads);
      team.run([&] { EXPECT_TRUE(solution(lower, team, most) == expected) << threads << " threads"; });
    }
  }
}

TEST(LinearSolver, SaysThatThereIsNoFactor) {
  LinearSolver::Matrix lower(2, 2);
  lower.insert(0, 0) = 0;
  lower.insert(1, 1) = 1;
  const Team team(1);
  LinearSolver solver(team);
  solver.analyse(lower);
  EXPECT_FALSE(solver.factorise(lower));
}

}  // namespace
}  // namespace varimesh
