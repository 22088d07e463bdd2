// The Bernstein coefficients of one cell's J: its determinant, with an error that covers the rounding.
#include "core/validity/cell_coefficients.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/reference/basis.h"
#include "tests/core/support/bernstein_cells.h"

namespace varimesh::detail {
namespace {

class CellCoefficients : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, CellCoefficients, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(CellCoefficients, AreTheBernsteinFormOfTheDeterminant) {
  const Shape shape = GetParam();
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = testing::shaken_cells(shape, order, 1, 0.3, static_cast<unsigned>(order));
    const int d = mesh.dimension;
    const auto coefficients = extended_coefficients(hard_cell(mesh, 0)).values;
    // Points strictly inside: at its apex the pyramid's basis is not defined.
    reference::Points points = reference::uniform_lattice(shape, 3);
    const Eigen::RowVectorXd middle = points.colwise().mean();
    points = (0.9 * points).rowwise() + 0.1 * middle;
    const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, d, points);
    const int nodes = reference::node_count(shape, order);
    Eigen::MatrixXd x(nodes, d);
    for (int n = 0; n < nodes; ++n)
      for (int c = 0; c < d; ++c) x(n, c) = mesh.coordinates[static_cast<std::size_t>(3 * n + c)];
    for (Eigen::Index p = 0; p < points.rows(); ++p) {
      Eigen::MatrixXd jacobian(d, d);
      for (int r = 0; r < d; ++r) jacobian.col(r) = (gradients[static_cast<std::size_t>(r)].row(p) * x).transpose();
      const double expected = jacobian.determinant();
      EXPECT_NEAR(evaluate(jacobian_table(shape, order).jacobian, coefficients, barycentric(shape, points.row(p))),
                  expected, 1e-10 * std::max(1.0, std::abs(expected)))
          << "order " << order << ", point " << points.row(p);
    }
  }
}

TEST_P(CellCoefficients, InDoubleAreWithinTheErrorTheyState) {
  for (int order = 1; order <= 5; ++order) {
    const HighOrderMesh mesh = testing::shaken_cells(GetParam(), order, 1, 0.05, static_cast<unsigned>(order));
    const Coefficients<double> plain = plain_coefficients(hard_cell(mesh, 0));
    const Coefficients<long double> exact = extended_coefficients(hard_cell(mesh, 0));
    ASSERT_EQ(plain.values.size(), exact.values.size());
    EXPECT_GT(plain.error, 0);
    EXPECT_LT(exact.error, plain.error) << "wider arithmetic errs by less";
    for (std::size_t k = 0; k < plain.values.size(); ++k)
      EXPECT_LE(std::abs(static_cast<long double>(plain.values[k]) - exact.values[k]),
                static_cast<long double>(plain.error) + exact.error);
  }
}

TEST_P(CellCoefficients, FollowScaleAndSign) {
  const HighOrderMesh mesh = testing::shaken_cells(GetParam(), 2, 1, 0.05, 1);
  CellToCertify cell = hard_cell(mesh, 0);
  const std::vector<double> plain = plain_coefficients(cell).values;
  cell.scale = 0.25;
  cell.sign = -1;
  const std::vector<double> scaled = plain_coefficients(cell).values;
  const double factor = -std::pow(0.25, mesh.dimension);
  for (std::size_t k = 0; k < plain.size(); ++k) EXPECT_EQ(scaled[k], factor * plain[k]) << "powers of two are exact";
}

TEST_P(CellCoefficients, KnowWhereAPointOfTheCellIs) {
  HighOrderMesh mesh = testing::shaken_cells(GetParam(), 3, 1, 0.1, 2);
  const int d = mesh.dimension;
  if (d == 2)  // a surface in space
    for (std::size_t i = 0; i < mesh.coordinates.size(); i += 3) mesh.coordinates[i + 2] = std::sin(double(i));
  reference::Points points = reference::uniform_lattice(GetParam(), 3);
  const Eigen::RowVectorXd middle = points.colwise().mean();
  points = (0.9 * points).rowwise() + 0.1 * middle;
  const Eigen::MatrixXd values = reference::basis_values(GetParam(), 3, reference::NodeSet::Equispaced, d, points);
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    const std::array<double, 3> place = physical_place(hard_cell(mesh, 0), barycentric(GetParam(), points.row(p)));
    for (int c = 0; c < 3; ++c) {
      double expected = 0;
      for (Eigen::Index n = 0; n < values.cols(); ++n)
        expected += values(p, n) * mesh.coordinates[static_cast<std::size_t>(3 * n + c)];
      EXPECT_NEAR(place[static_cast<std::size_t>(c)], expected, 1e-12);
    }
  }
}

}  // namespace
}  // namespace varimesh::detail
