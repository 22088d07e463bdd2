// Modal bases: orthonormal, and with the gradients of their values.
#include "core/reference/modal.h"

#include <gtest/gtest.h>

#include "core/reference/quadrature.h"
#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

TEST(Modal, IsOrthonormal) {
  for (const Shape shape : kCells) {
    const int order = shape == Shape::Hexahedron || shape == Shape::Prism ? 4 : 6;
    const Quadrature rule = quadrature(shape, order, 2 * order);
    const Eigen::MatrixXd values = modal_values(shape, order, rule.points);
    const Eigen::MatrixXd gram = values.transpose() * rule.weights.asDiagonal() * values;
    EXPECT_LT((gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).cwiseAbs().maxCoeff(), 1e-12)
        << at(shape, order);
  }
}

TEST(Modal, HasTheGradientsOfItsValues) {
  for (const Shape shape : kCells) {
    const Quadrature rule = quadrature(shape, 3, 6);  // points inside
    const auto gradients = modal_gradients(shape, 4, rule.points);
    ASSERT_EQ(static_cast<int>(gradients.size()), info(shape).dimension);
    for (int d = 0; d < info(shape).dimension; ++d) {
      constexpr double kStep = 1e-6;
      Points above = rule.points, below = rule.points;
      above.col(d).array() += kStep;
      below.col(d).array() -= kStep;
      const Eigen::MatrixXd difference = (modal_values(shape, 4, above) - modal_values(shape, 4, below)) / (2 * kStep);
      EXPECT_LT((gradients[d] - difference).cwiseAbs().maxCoeff(), 1e-7 * (1 + difference.cwiseAbs().maxCoeff()))
          << info(shape).name;
    }
  }
}

TEST(Modal, HasAModeForEveryNode) {
  for (const Shape shape : kCells)
    for (int order = 1; order <= 5; ++order)
      EXPECT_EQ(modal_values(shape, order, nodes(shape, order, NodeSet::Equispaced, 3)).cols(),
                node_count(shape, order))
          << at(shape, order);
}

TEST(Modal, TheModesUpToADegreeAreThoseOfTheLowerOrder) {
  for (const Shape shape : kCells)
    for (int order = 1; order <= 5; ++order) {
      const std::vector<int> degrees = modal_degrees(shape, order);
      ASSERT_EQ(static_cast<int>(degrees.size()), node_count(shape, order)) << at(shape, order);
      const Quadrature rule = quadrature(shape, order, 2);
      const Eigen::MatrixXd modes = modal_values(shape, order, rule.points);
      for (int low = 1; low <= order; ++low) {
        const Eigen::MatrixXd lower = modal_values(shape, low, rule.points);
        Eigen::Index found = 0;
        for (Eigen::Index mode = 0; mode < modes.cols(); ++mode)
          if (degrees[static_cast<std::size_t>(mode)] <= low) {
            ASSERT_LT(found, lower.cols()) << at(shape, order);
            EXPECT_LT((modes.col(mode) - lower.col(found++)).norm(), 1e-12) << at(shape, order);
          }
        EXPECT_EQ(found, lower.cols()) << at(shape, order);
      }
    }
}

}  // namespace
}  // namespace varimesh::reference
