// Bernstein coefficients of J from optimised nodes: those of the certificates, and their slopes.
#include "core/solvers/untangle/coefficient_table.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "core/kernels/dense/dense_product.h"
#include "core/reference/basis.h"
#include "tests/core/support/bernstein_cells.h"

namespace varimesh {
namespace {

class CoefficientTableOf : public ::testing::TestWithParam<Shape> {
 protected:
  /// Optimised nodes of the reference cell, shaken.
  static Eigen::MatrixXd positions(int order) {
    const int d = reference::info(GetParam()).dimension;
    Eigen::MatrixXd x = reference::nodes(GetParam(), order, reference::NodeSet::Optimised, d);
    std::mt19937 random(static_cast<unsigned>(order));
    std::uniform_real_distribution<double> shake(-0.1, 0.1);
    for (Eigen::Index i = 0; i < x.size(); ++i) x(i / d, i % d) += shake(random);
    return x;
  }

  static Eigen::VectorXd coefficients(const CoefficientTable& table, const Eigen::MatrixXd& x) {
    const auto derivatives = table.derivatives(x);
    return table.jacobian(derivatives, table.cofactors(derivatives));
  }
};

INSTANTIATE_TEST_SUITE_P(Shapes, CoefficientTableOf, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(CoefficientTableOf, HasTheCoefficientsOfTheCertificates) {
  for (int order = 1; order <= 4; ++order) {
    const CoefficientTable& table = coefficient_table(GetParam(), order);
    const int d = table.dimension;
    const Eigen::MatrixXd x = positions(order);
    // The certificates use the file's equispaced nodes.
    const Eigen::MatrixXd equispaced =
        reference::conversion(GetParam(), order, reference::NodeSet::Optimised, reference::NodeSet::Equispaced, d) * x;
    HighOrderMesh mesh = testing::one_cell(GetParam(), order, [](testing::Place p) { return p; });
    for (Eigen::Index n = 0; n < equispaced.rows(); ++n)
      for (int k = 0; k < d; ++k) mesh.coordinates[std::size_t(3 * n + k)] = equispaced(n, k);
    const auto exact = detail::extended_coefficients(detail::hard_cell(mesh, 0)).values;
    const Eigen::VectorXd found = coefficients(table, x);
    ASSERT_EQ(found.size(), Eigen::Index(exact.size()));
    for (Eigen::Index k = 0; k < found.size(); ++k)
      EXPECT_NEAR(found[k], double(exact[std::size_t(k)]), 1e-10 * found.cwiseAbs().maxCoeff());
  }
}

TEST_P(CoefficientTableOf, HasTheSlopesOfTheCoefficients) {
  const int order = 3;
  const CoefficientTable& table = coefficient_table(GetParam(), order);
  Eigen::MatrixXd x = positions(order);
  std::vector<int> nodes;
  for (int n = 0; n < int(x.rows()); n += 2) nodes.push_back(n);
  const Eigen::MatrixXd slope = table.slope(table.cofactors(table.derivatives(x)), nodes);
  ASSERT_EQ(slope.rows(), table.size);
  ASSERT_EQ(slope.cols(), Eigen::Index(nodes.size()) * table.dimension);
  constexpr double h = 1e-4;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (int c = 0; c < table.dimension; ++c) {
      double& at = x(nodes[i], c);
      const double start = at;
      at = start + h;
      const Eigen::VectorXd above = coefficients(table, x);
      at = start - h;
      const Eigen::VectorXd below = coefficients(table, x);
      at = start;
      const Eigen::VectorXd error = slope.col(Eigen::Index(i) * table.dimension + c) - (above - below) / (2 * h);
      EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-6 * (1 + slope.cwiseAbs().maxCoeff()));
    }
}

TEST(CoefficientTable, HasTheSameSlopesIfItsProductsAreCutUp) {
  // The products of a whole hexahedron of order 7 are cut into pieces, those of a few nodes are not.
  const CoefficientTable& table = coefficient_table(Shape::Hexahedron, 7);
  const Eigen::MatrixXd x = reference::nodes(Shape::Hexahedron, 7, reference::NodeSet::Optimised, 3);
  std::vector<int> all(std::size_t(x.rows()));
  std::iota(all.begin(), all.end(), 0);
  ASSERT_GT(2.0 * double(table.size * table.derivative[0].rows() * x.rows()), double(detail::kOperationsPerLook));
  const auto cofactors = table.cofactors(table.derivatives(x));
  const std::vector<int> few = {0, 100, 300, 511};
  const Eigen::MatrixXd whole = table.slope(cofactors, all), part = table.slope(cofactors, few);
  for (std::size_t i = 0; i < few.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const Eigen::VectorXd error = whole.col(3 * few[i] + c) - part.col(3 * Eigen::Index(i) + c);
      EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-12 * part.cwiseAbs().maxCoeff());
    }
  const StopToken stopped([] { return true; });
  EXPECT_THROW(table.slope(cofactors, few, &stopped), Interrupted);
}

TEST_P(CoefficientTableOf, DoesNotDependOnWhereTheCellLies) {
  const CoefficientTable& table = coefficient_table(GetParam(), 2);
  const Eigen::MatrixXd x = positions(2);
  const Eigen::VectorXd here = coefficients(table, x);
  const Eigen::VectorXd there = coefficients(table, x.array() + 1e6);
  EXPECT_LT((here - there).cwiseAbs().maxCoeff(), 1e-8);
}

}  // namespace
}  // namespace varimesh
