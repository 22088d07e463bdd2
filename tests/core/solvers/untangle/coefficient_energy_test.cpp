// The energy of untangling: derivatives against differences, eigenvalues of the Hessian, coefficients that bound J.
#include "core/solvers/untangle/coefficient_energy.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "core/validity/bernstein.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using Cell = CoefficientEnergy::Cell;

enum class State { Good, Tangled };

std::string name(State state) { return state == State::Good ? "Good" : "Tangled"; }

void PrintTo(State state, std::ostream* out) { *out << name(state); }

/// The first cell of each shape in a mesh, with every second node free.
class CoefficientEnergyTest : public ::testing::TestWithParam<std::tuple<Filling, int, State>> {
 protected:
  void SetUp() override {
    const auto [filling, order, state] = GetParam();
    mesh_ = testing::grid(filling, {2, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
    problem_ = testing::make_problem(mesh_);
    // The steps of the differences below suit cells of this size.
    for (double& x : problem_.positions) x *= 4;
    for (CellSet& set : problem_.sets) {
      for (double& a : set.inverse_target) a /= 4;
      for (double& m : set.measure) m *= std::pow(4, problem_.dimension);
    }
    for (const CellSet& set : problem_.sets) energies_.emplace_back(set);
    for (std::size_t b = 0; b < problem_.sets.size(); ++b) cells_.push_back(make_cell(b, state == State::Tangled));
  }

  Cell make_cell(std::size_t b, bool tangled) {
    const CellSet& set = problem_.sets[b];
    Cell cell;
    cell.positions.resize(set.nodes_per_cell, problem_.dimension);
    std::uniform_real_distribution<double> push(-1, 1);
    for (int n = 0; n < set.nodes_per_cell; ++n) {
      if (n % 2 == 1 || n == 0) cell.free.push_back(n);
      for (int k = 0; k < problem_.dimension; ++k)
        cell.positions(n, k) = problem_.positions[std::size_t(set.nodes[std::size_t(n)] * problem_.dimension + k)] +
                               (tangled ? 0.4 : 0.01) * push(random_);
    }
    energies_[b].find_movable(cell);
    return cell;
  }

  /// The derivatives of E by each unknown, from differences of fourth order.
  Eigen::VectorXd differences(std::size_t b, double epsilon) {
    constexpr double h = 1e-4;
    Cell cell = cells_[b];
    Eigen::VectorXd out(Eigen::Index(cell.free.size()) * problem_.dimension);
    for (Eigen::Index u = 0; u < out.size(); ++u) {
      double& x = cell.positions(cell.free[std::size_t(u / problem_.dimension)], u % problem_.dimension);
      const double start = x;
      const auto at = [&](double shift) {
        x = start + shift;
        return energies_[b].value(cell, epsilon);
      };
      out[u] = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
      x = start;
    }
    return out;
  }

  void expect_derivatives(double epsilon) {
    for (std::size_t b = 0; b < cells_.size(); ++b) {
      const auto expansion = energies_[b].expand(cells_[b], epsilon);
      EXPECT_NEAR(expansion.value, energies_[b].value(cells_[b], epsilon), 1e-12 * expansion.value);
      const double error = (expansion.gradient - differences(b, epsilon)).cwiseAbs().maxCoeff();
      EXPECT_LE(error, 1e-7 * expansion.gradient.cwiseAbs().maxCoeff());
      EXPECT_LE((expansion.hessian - expansion.hessian.transpose()).cwiseAbs().maxCoeff(),
                1e-12 * expansion.hessian.cwiseAbs().maxCoeff());
      const Eigen::VectorXd eigenvalues =
          Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(expansion.hessian, Eigen::EigenvaluesOnly).eigenvalues();
      EXPECT_GE(eigenvalues.minCoeff(), -1e-11 * eigenvalues.maxCoeff());
      EXPECT_GT(eigenvalues.maxCoeff(), 0);
    }
  }

  HighOrderMesh mesh_;
  Problem problem_;
  std::vector<CoefficientEnergy> energies_;
  std::vector<Cell> cells_;
  std::mt19937_64 random_{11};
};

TEST_P(CoefficientEnergyTest, HasExactGradientsAndSemidefiniteHessians) { expect_derivatives(0.5); }

TEST_P(CoefficientEnergyTest, HasThemForUnrepairableCells) {
  for (std::size_t b = 0; b < cells_.size(); ++b) {
    cells_[b].unrepairable = true;
    energies_[b].find_movable(cells_[b]);
    EXPECT_TRUE(cells_[b].movable.empty());
    EXPECT_EQ(energies_[b].smallest_coefficient(cells_[b]), std::numeric_limits<double>::infinity());
    EXPECT_EQ(energies_[b].value(cells_[b], 1e-3), energies_[b].value(cells_[b], 10.0))
        << "ε has no effect on unrepairable cells";
  }
  expect_derivatives(0.5);
}

TEST_P(CoefficientEnergyTest, HasThemWithAMetricsLeftFactor) {
  for (CellSet& set : problem_.sets) {
    Eigen::MatrixXd factor = Eigen::MatrixXd::Identity(problem_.dimension, problem_.dimension);
    factor(0, 1) = factor(1, 0) = 0.3;
    factor /= std::pow(factor.determinant(), 1.0 / problem_.dimension);
    for (std::int32_t cell = 0; cell < set.count; ++cell)
      set.left_factor.insert(set.left_factor.end(), factor.data(), factor.data() + factor.size());
  }
  expect_derivatives(0.5);
}

/// The mean of the Bernstein coefficients is the mean of the polynomial. On pyramids the coefficients belong to a
/// transformed polynomial and only bound J.
TEST_P(CoefficientEnergyTest, HasTheBernsteinCoefficientsOfJ) {
  for (std::size_t b = 0; b < cells_.size(); ++b) {
    const CellSet& set = problem_.sets[b];
    const int d = problem_.dimension;
    const reference::Quadrature rule = reference::quadrature(set.shape, set.order, 3 * set.order);
    const auto gradients =
        reference::basis_gradients(set.shape, set.order, reference::NodeSet::Optimised, d, rule.points);
    double target = 0, weights = 0, mean = 0, sum = 0, least = std::numeric_limits<double>::infinity();
    for (int q = 0; q < set.points; ++q) {
      weights += set.weights[std::size_t(q)];
      target += set.affine ? set.weights[std::size_t(q)] * set.measure[0] : set.measure[std::size_t(q)];
    }
    for (Eigen::Index q = 0; q < rule.points.rows(); ++q) {
      Eigen::MatrixXd gradient(d, d);
      for (int k = 0; k < d; ++k)
        gradient.col(k) = cells_[b].positions.transpose() * gradients[std::size_t(k)].row(q).transpose();
      const double jacobian = gradient.determinant() * weights / target, weight = rule.weights[std::size_t(q)];
      least = std::min(least, jacobian);
      mean += weight * jacobian;
      sum += weight;
    }
    mean /= sum;
    const Eigen::VectorXd B = energies_[b].coefficients(cells_[b]);
    const double size = B.cwiseAbs().maxCoeff();
    EXPECT_LE(B.minCoeff(), least + 1e-10 * size);
    if (set.shape != Shape::Pyramid) {
      EXPECT_NEAR(B.mean(), mean, 1e-10 * size);
    }
    if (set.affine && set.order == 1) {
      EXPECT_NEAR(B.minCoeff(), least, 1e-12 * size);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, CoefficientEnergyTest,
                         ::testing::Combine(::testing::ValuesIn(testing::kFillings), ::testing::Values(1, 2, 3),
                                            ::testing::Values(State::Good, State::Tangled)),
                         [](const auto& info) {
                           return std::string(testing::name(std::get<0>(info.param))) +
                                  std::to_string(std::get<1>(info.param)) + name(std::get<2>(info.param));
                         });

TEST(CoefficientEnergyTest, LeavesOutCoefficientsThatNoFreeNodeMoves) {
  const HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {1, 1, 1}, 3);
  Problem problem = testing::make_problem(mesh);
  const CoefficientEnergy energy(problem.sets[0]);
  Cell cell;
  cell.positions.resize(problem.sets[0].nodes_per_cell, 3);
  for (int n = 0; n < problem.sets[0].nodes_per_cell; ++n)
    for (int k = 0; k < 3; ++k)
      cell.positions(n, k) = problem.positions[std::size_t(problem.sets[0].nodes[std::size_t(n)] * 3 + k)];
  cell.free = {0};
  energy.find_movable(cell);
  const detail::JacobianTable& table = detail::jacobian_table(Shape::Tetrahedron, 3);
  // A vertex moves all coefficients. A node inside an edge does not move J at the two vertices that are not on the
  // edge.
  EXPECT_EQ(cell.movable.size(), std::size_t(table.jacobian.size()));
  cell.free = {4};
  energy.find_movable(cell);
  int moved = 0;
  for (const std::uint16_t corner : table.corners) moved += std::ranges::count(cell.movable, int(corner)) > 0 ? 1 : 0;
  EXPECT_EQ(moved, 2);
}

TEST(RegularisedJacobian, DoesNotCancelBelowZero) {
  // χ = ε²/(4 |J|) (1 + O(ε²/J²))
  EXPECT_NEAR(regularised_jacobian(-1.0, 1e-8) / 2.5e-17, 1, 1e-12);
  EXPECT_DOUBLE_EQ(regularised_jacobian(0.0, 2.0), 1.0);
  EXPECT_NEAR(regularised_jacobian(3.0, 1e-9), 3.0, 1e-15);
}

}  // namespace
}  // namespace varimesh
