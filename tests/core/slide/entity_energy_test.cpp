#include "core/slide/entity_energy.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numeric>

#include "core/energy/hyperelastic-inl.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

struct Cell {
  std::vector<EntityElement> elements;
  std::vector<double> coordinates;
  Eigen::Matrix<double, 3, Eigen::Dynamic> x, normal;
};

/// One element near the plane z = 0 (a line near the x axis), bent by smooth functions.
Cell cell(Shape shape, int order) {
  Cell cell;
  const reference::Points& nodes = reference::nodes(shape, order, reference::NodeSet::Equispaced, 3);
  cell.x.resize(3, nodes.rows());
  cell.normal.resize(3, nodes.rows());
  EntityElement& element = cell.elements.emplace_back();
  element.shape = shape;
  for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
    const double s = nodes(i, 0), t = nodes.cols() > 1 ? nodes(i, 1) : 0;
    cell.x.col(i) << s + 0.1 * std::sin(2 * t + s), (nodes.cols() > 1 ? t : 0) + 0.15 * std::cos(s - t),
        0.2 * std::sin(s + 0.5 * t);
    const Eigen::Vector3d up(0.1 * s, -0.2 * t, 1), along(1, 0.1 * s, 0.2);
    cell.normal.col(i) = (nodes.cols() > 1 ? up : along).normalized();
    element.nodes.push_back(static_cast<std::int32_t>(i));
    for (int k = 0; k < 3; ++k) cell.coordinates.push_back(cell.x(k, i));
  }
  return cell;
}

template <int d>
void check_gradient(Shape shape, int order, double delta) {
  const Cell made = cell(shape, order);
  const EntityEnergy<d> energy(made.elements, order, made.coordinates);
  Eigen::VectorXd gradient;
  Eigen::MatrixXd hessian;
  energy.derivatives(0, made.x, made.normal, delta, gradient, hessian);
  constexpr double h = 1e-6;
  for (Eigen::Index k = 0; k < gradient.size(); ++k) {
    auto up = made.x, down = made.x;
    up(k % 3, k / 3) += h;
    down(k % 3, k / 3) -= h;
    const double slope =
        (energy.value(0, up, made.normal, delta).energy - energy.value(0, down, made.normal, delta).energy) / (2 * h);
    EXPECT_NEAR(gradient[k], slope, 1e-7 * (1 + gradient.cwiseAbs().maxCoeff())) << k;
  }
  EXPECT_LT((hessian - hessian.transpose()).norm(), 1e-12 * hessian.norm());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian);
  EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-10 * eigen.eigenvalues().maxCoeff());
}

TEST(EntityEnergy, HasTheGradientOfItsValue) {
  for (const double delta : {0.0, 0.3}) {
    check_gradient<1>(Shape::Line, 3, delta);
    check_gradient<2>(Shape::Triangle, 4, delta);
    check_gradient<2>(Shape::Quadrilateral, 3, delta);
  }
}

// With the inner node free only, F is constant at the vertices. The triangle is folded at its first: two nodes beside
// it have changed places.
TEST(EntityEnergy, LeavesOutConstantPointsOnly) {
  Cell made = cell(Shape::Triangle, 3);
  std::vector<bool> free;
  Eigen::Index beside[2] = {-1, -1}, inner = -1;
  for (const auto& place : reference::lattice(Shape::Triangle, 3)) {
    const auto i = static_cast<Eigen::Index>(free.size());
    free.push_back(place[0] == 1 && place[1] == 1);
    if (free.back()) inner = i;
    if (place[0] + place[1] == 1) beside[place[0]] = i;
  }
  made.x.col(beside[0]).swap(made.x.col(beside[1]));
  const EntityEnergy<2> whole(made.elements, 3, made.coordinates);
  EntityEnergy<2> part = whole, none = whole;
  part.leave_out_constant_points(0, free);
  none.leave_out_constant_points(0, std::vector<bool>(free.size(), false));
  constexpr double kDelta = 0.2;
  auto moved = made.x;
  moved.col(inner) += Eigen::Vector3d(0.03, -0.02, 0.05);
  const auto before = whole.value(0, made.x, made.normal, kDelta), after = whole.value(0, moved, made.normal, kDelta);
  const auto part_before = part.value(0, made.x, made.normal, kDelta);
  EXPECT_NEAR(part.value(0, moved, made.normal, kDelta).energy - part_before.energy, after.energy - before.energy,
              1e-12 * before.energy);
  EXPECT_LT(part_before.energy, before.energy);
  EXPECT_LT(before.least, -1);
  EXPECT_EQ(part_before.least, before.least);
  EXPECT_EQ(before.least_movable, before.least);
  EXPECT_GT(part_before.least_movable, before.least);
  Eigen::VectorXd gradient, part_gradient;
  Eigen::MatrixXd hessian, part_hessian;
  whole.derivatives(0, made.x, made.normal, kDelta, gradient, hessian);
  part.derivatives(0, made.x, made.normal, kDelta, part_gradient, part_hessian);
  EXPECT_LT((gradient - part_gradient).segment<3>(3 * inner).norm(), 1e-12 * gradient.norm());
  const Eigen::MatrixXd apart = hessian - part_hessian;
  EXPECT_LT((apart.block<3, 3>(3 * inner, 3 * inner).norm()), 1e-12 * hessian.norm());
  const auto nothing = none.value(0, made.x, made.normal, 0);
  EXPECT_EQ(nothing.energy, 0);
  EXPECT_EQ(nothing.least, before.least);
  EXPECT_TRUE(std::isinf(nothing.least_movable));
}

/// The Hessian as the header has it, point by point: 2 w f_Q (g_a · g_b) I + w max(f_JJ, 0) c_a ⊗ c_b.
template <int d>
Eigen::MatrixXd plain_hessian(const Cell& made, int order, double delta) {
  using Density = HWY_NAMESPACE::HyperelasticEnergy<d>;
  const EntityElement& element = made.elements[0];
  const EntityTable& table = entity_table(element.shape, order);
  const Density density(material(Options{}));
  const Eigen::Index nodes = made.x.cols(), vertices = table.straight[0].cols();
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(3 * nodes, 3 * nodes);
  double measure = 0;
  for (const bool measures : {true, false})
    for (Eigen::Index p = 0; p < table.weights.size(); ++p) {
      Eigen::Matrix<double, 3, d> straight, G;
      for (int k = 0; k < d; ++k) {
        const auto direction = static_cast<std::size_t>(k);
        straight.col(k) = made.x.leftCols(vertices) * table.straight[direction].row(p).transpose();
        G.col(k) = made.x * table.derivatives[direction].col(p);
      }
      // R is the triangular factor of the straight-sided derivative: RᵀR is its metric.
      const Eigen::Matrix<double, d, d> R = (straight.transpose() * straight).llt().matrixU();
      if (measures) measure += table.weights[p] * R.determinant();
      if (measures) continue;
      const Eigen::Matrix<double, 3, d> F = G * R.inverse();
      const Eigen::Vector3d N = (made.normal * table.values.row(p).transpose()).normalized();
      Eigen::Matrix<double, 3, d> C;
      double J = 0;
      if constexpr (d == 1) {
        C = N;
        J = N.dot(F.col(0));
      } else {
        C << F.col(1).cross(N), N.cross(F.col(0));
        J = N.dot(F.col(0).cross(F.col(1)));
      }
      const auto f =
          density.partials(F.squaredNorm(), HWY_NAMESPACE::regularised<Density::kFunction>(J, delta * delta));
      const double w = measure * table.weights[p];
      for (Eigen::Index a = 0; a < nodes; ++a)
        for (Eigen::Index b = 0; b < nodes; ++b) {
          Eigen::Matrix<double, d, 1> ga, gb;
          for (int k = 0; k < d; ++k) {
            ga[k] = table.derivatives[static_cast<std::size_t>(k)](a, p);
            gb[k] = table.derivatives[static_cast<std::size_t>(k)](b, p);
          }
          ga = R.transpose().inverse() * ga;
          gb = R.transpose().inverse() * gb;
          hessian.block<3, 3>(3 * a, 3 * b) += 2 * w * f.f_Q * ga.dot(gb) * Eigen::Matrix3d::Identity() +
                                               w * std::max(f.f_JJ, 0.0) * (C * ga) * (C * gb).transpose();
        }
    }
  return hessian;
}

template <int d>
void check_hessian(Shape shape, int order, double delta) {
  const Cell made = cell(shape, order);
  const EntityEnergy<d> energy(made.elements, order, made.coordinates);
  Eigen::VectorXd gradient;
  Eigen::MatrixXd hessian;
  energy.derivatives(0, made.x, made.normal, delta, gradient, hessian);
  const Eigen::MatrixXd plain = plain_hessian<d>(made, order, delta);
  EXPECT_LT((hessian - plain).cwiseAbs().maxCoeff(), 1e-12 * plain.cwiseAbs().maxCoeff());
}

TEST(EntityEnergy, HasTheHessianOfAPlainSum) {
  for (const double delta : {0.0, 0.3}) {
    check_hessian<1>(Shape::Line, 3, delta);
    check_hessian<2>(Shape::Triangle, 4, delta);
    check_hessian<2>(Shape::Quadrilateral, 3, delta);
  }
}

TEST(EntityEnergy, IsZeroOnAStraightSidedElement) {
  Cell made = cell(Shape::Triangle, 2);
  const reference::Points& nodes = reference::nodes(Shape::Triangle, 2, reference::NodeSet::Equispaced, 3);
  for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
    made.x.col(i) << 2 * nodes(i, 0) + nodes(i, 1), nodes(i, 1), 0;
    made.normal.col(i) << 0, 0, 1;
    for (int k = 0; k < 3; ++k) made.coordinates[static_cast<std::size_t>(3 * i + k)] = made.x(k, i);
  }
  const EntityEnergy<2> energy(made.elements, 2, made.coordinates);
  const auto value = energy.value(0, made.x, made.normal, 0);
  EXPECT_NEAR(value.energy, 0, 1e-13);
  EXPECT_NEAR(value.least, 1, 1e-13);
}

TEST(EntityEnergy, OfAFoldedElementIsInfiniteWithoutRegularisation) {
  Cell made = cell(Shape::Triangle, 2);
  const EntityEnergy<2> energy(made.elements, 2, made.coordinates);
  const Eigen::Matrix<double, 3, Eigen::Dynamic> below = -made.normal;
  EXPECT_LT(energy.value(0, made.x, below, 0).least, 0);
  EXPECT_TRUE(std::isinf(energy.value(0, made.x, below, 0).energy));
  EXPECT_TRUE(std::isfinite(energy.value(0, made.x, below, 0.1).energy));
}

}  // namespace
}  // namespace varimesh::detail
