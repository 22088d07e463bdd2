// The loss of accuracy: known answers, what it must not depend on, and a projection by quadrature as plain reference.
#include "core/quality/accuracy/accuracy.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "core/reference/basis.h"
#include "core/reference/modal.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/made_cells.h"

namespace varimesh {
namespace {

using testing::kCellShapes;
using testing::Place;

class AccuracyOfShape : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, AccuracyOfShape, ::testing::ValuesIn(kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

/// The highest order that is tested on this shape. The reference computes hexahedra of order 10 in minutes.
int highest_order(Shape shape) { return reference::info(shape).dimension == 2 || shape == Shape::Tetrahedron ? 10 : 6; }

/// The straight-sided map of a cell whose vertices differ from those of the reference cell. It is not affine, except on
/// simplices.
Place straight(Shape shape, Place at) {
  reference::Points point(1, reference::info(shape).dimension);
  for (Eigen::Index c = 0; c < point.cols(); ++c) point(0, c) = at[static_cast<std::size_t>(c)];
  const Eigen::MatrixXd values =
      reference::basis_values(shape, 1, reference::NodeSet::Equispaced, static_cast<int>(point.cols()), point);
  Place sum{};
  for (Eigen::Index v = 0; v < values.cols(); ++v)
    for (std::size_t c = 0; c < static_cast<std::size_t>(point.cols()); ++c)
      sum[c] += values(0, v) * (reference::info(shape).vertex[static_cast<std::size_t>(v)][c] +
                                0.2 * std::sin(static_cast<double>(v) * 2.3 + static_cast<double>(c)));
  return sum;
}

TEST_P(AccuracyOfShape, AStraightSidedCellLosesNone) {
  for (int order = 1; order <= highest_order(GetParam()); ++order) {
    const HighOrderMesh mesh = testing::one_cell(GetParam(), order, [](Place at) { return straight(GetParam(), at); });
    const Accuracy found = accuracy(mesh);
    EXPECT_LT(found.loss, 1e-10) << "order " << order;
    ASSERT_EQ(found.modal_parts.size(), static_cast<std::size_t>(order - 1));
    for (const double part : found.modal_parts) EXPECT_LT(part, 1e-10) << "order " << order;
  }
}

TEST_P(AccuracyOfShape, DoesNotChangeIfTheMeshIsMovedTurnedAndScaled) {
  const int order = 4;
  HighOrderMesh mesh = testing::shaken_cells(GetParam(), order, 20, 0.05, 1);
  const CellAccuracy before = cell_accuracy(mesh);
  const double total = accuracy(mesh).loss;
  const double c = std::cos(0.7), s = std::sin(0.7);
  for (std::size_t i = 0; i < mesh.coordinates.size(); i += 3) {
    const double x = mesh.coordinates[i], y = mesh.coordinates[i + 1], z = mesh.coordinates[i + 2];
    mesh.coordinates[i] = 30 * (c * x - s * y) + 7;
    mesh.coordinates[i + 1] = 30 * (s * x + c * y) - 11;
    mesh.coordinates[i + 2] = mesh.dimension == 3 ? 30 * z + 5 : 0;
  }
  const CellAccuracy after = cell_accuracy(mesh);
  for (std::size_t cell = 0; cell < before.loss.size(); ++cell)
    EXPECT_NEAR(after.loss[cell], before.loss[cell], 1e-11 * before.loss[cell]);
  EXPECT_NEAR(accuracy(mesh).loss, total, 1e-11 * total);
}

/// m_s of one cell as the formula says: the map is projected on the modes of degree up to s and up to s − 1 by
/// quadrature; the gradient of the difference is integrated.
std::vector<double> plain_parts(const HighOrderMesh& mesh, std::size_t cell) {
  const ElementBlock& block = mesh.blocks[0];
  const int d = mesh.dimension, nodes = reference::node_count(block.shape, block.order);
  const reference::Quadrature rule = reference::quadrature(block.shape, block.order, 2 * block.order + 2);
  const auto set = reference::NodeSet::Equispaced;
  Eigen::MatrixXd x(nodes, d);
  for (int n = 0; n < nodes; ++n)
    for (int c = 0; c < d; ++c) {
      const auto node = static_cast<std::size_t>(block.nodes[cell * static_cast<std::size_t>(nodes) + n]);
      x(n, c) = mesh.coordinates[3 * node + static_cast<std::size_t>(c)];
    }
  const Eigen::MatrixXd map = reference::basis_values(block.shape, block.order, set, d, rule.points) * x;
  const auto gradients = reference::basis_gradients(block.shape, block.order, set, d, rule.points);
  Eigen::MatrixXd jacobian(d, d);
  for (int r = 0; r < d; ++r) jacobian.col(r) = (rule.weights.transpose() * gradients[r] * x).transpose();
  jacobian /= rule.weights.sum();
  const auto gradient_up_to = [&](int degree) {  // of the projection, one matrix per direction
    const Eigen::MatrixXd values = reference::modal_values(block.shape, degree, rule.points);
    const Eigen::MatrixXd coefficients = values.transpose() * rule.weights.asDiagonal() * map;
    std::vector<Eigen::MatrixXd> all = reference::modal_gradients(block.shape, degree, rule.points);
    for (Eigen::MatrixXd& one : all) one *= coefficients;
    return all;
  };
  std::vector<double> parts;
  for (int degree = 2; degree <= block.order; ++degree) {
    const auto high = gradient_up_to(degree), low = gradient_up_to(degree - 1);
    double sum = 0;
    for (Eigen::Index q = 0; q < rule.weights.size(); ++q) {
      Eigen::MatrixXd gradient(d, d);
      for (int r = 0; r < d; ++r) gradient.col(r) = (high[r].row(q) - low[r].row(q)).transpose();
      sum += rule.weights[q] * (gradient * jacobian.inverse()).squaredNorm();
    }
    parts.push_back(std::sqrt(sum / rule.weights.sum()));
  }
  return parts;
}

TEST_P(AccuracyOfShape, AgreesWithAProjectionByQuadrature) {
  for (int order = 2; order <= highest_order(GetParam()); ++order) {
    const HighOrderMesh mesh = testing::shaken_cells(GetParam(), order, 3, 0.03, 2);
    const CellAccuracy found = cell_accuracy(mesh);
    ASSERT_EQ(found.parts, static_cast<std::size_t>(order - 1));
    for (std::size_t cell = 0; cell < 3; ++cell) {
      const std::vector<double> parts = plain_parts(mesh, cell);
      double loss = 0;
      const double share = found.volumes[cell] / (found.volumes[0] + found.volumes[1] + found.volumes[2]);
      for (std::size_t i = 0; i < parts.size(); ++i) {
        EXPECT_NEAR(found.modal_parts[cell * found.parts + i], parts[i], 1e-8 * parts[i]) << "order " << order;
        const double s = static_cast<double>(i) + 2;
        loss += std::pow(share, 2 * (order + 1 - s) / mesh.dimension) * parts[i] * parts[i];
      }
      EXPECT_NEAR(found.loss[cell], std::sqrt(loss), 1e-8 * found.loss[cell]) << "order " << order;
    }
  }
}

TEST_P(AccuracyOfShape, TheNumberOfThreadsDoesNotMatter) {
  const HighOrderMesh mesh = testing::shaken_cells(GetParam(), 3, 300, 0.2, 3);
  EXPECT_EQ(cell_accuracy(mesh, 1).loss, cell_accuracy(mesh, 2).loss);
  EXPECT_EQ(accuracy(mesh, 1).modal_parts, accuracy(mesh, 2).modal_parts);
}

TEST(Accuracy, OfACurvedQuadrilateralIsWhatAHandComputes) {
  // On the square [−1, 1]², ξ η has degree 1 and no part. x = ξ + c (3 η² − 1) / 2 has the part
  // c P₂(η) of degree 2, with ∫ P₂'² = 6 over [−1, 1]. So m₂² = 1/4 · 2 · 6 c² = 3 c². One cell has V_E = V.
  const double c = 0.1;
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 2, [&](Place at) {
    return Place{at[0] + c * (3 * at[1] * at[1] - 1) / 2, at[1], 0};
  });
  EXPECT_NEAR(accuracy(mesh).loss, std::numbers::sqrt3 * c, 1e-12);
}

TEST(Accuracy, ACollapsedCellHasAnInfiniteLoss) {
  const HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](Place at) { return Place{at[0] * at[0], 0, 0}; });
  EXPECT_EQ(accuracy(mesh).loss, std::numeric_limits<double>::infinity());
}

TEST(Accuracy, AHighDegreeCostsMoreThanALowOneInSmallCells) {
  // 50 cells, one with a bump of degree 2, one with a bump of degree 4, of the same displacement gradient.
  const HighOrderMesh quadratic = testing::shaken_cells(Shape::Quadrilateral, 4, 50, 0, 4);
  HighOrderMesh low = quadratic, high = quadratic;
  const double slope[] = {std::sqrt(6.0), std::sqrt(20.0)};  // ∫ P_n'² = n (n + 1)
  for (std::size_t n = 0; n < 25; ++n) {
    const double y = quadratic.coordinates[3 * n + 1];
    low.coordinates[3 * n] += 0.1 / slope[0] * std::legendre(2, y);
    high.coordinates[3 * n] += 0.1 / slope[1] * std::legendre(4, y);
  }
  EXPECT_NEAR(accuracy(low).modal_parts[0], accuracy(high).modal_parts[2], 1e-12);
  EXPECT_NEAR(accuracy(high).loss, 50 * accuracy(low).loss, 1e-9);  // (V/V_E)^(2/2)
}

}  // namespace
}  // namespace varimesh
