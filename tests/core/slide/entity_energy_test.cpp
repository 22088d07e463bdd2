#include "core/slide/entity_energy.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numeric>

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
