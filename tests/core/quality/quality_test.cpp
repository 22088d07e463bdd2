// The sampled quality: known answers, and the vectorised path against a plain one.
#include "core/quality/quality.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numeric>

#include "core/quality/certified_quality.h"
#include "core/reference/basis.h"
#include "tests/core/support/made_cells.h"

namespace varimesh {
namespace {

using testing::kCellShapes;
using testing::Place;

class QualityOfShape : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, QualityOfShape, ::testing::ValuesIn(kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(QualityOfShape, AnAffineCellIsPerfect) {
  for (int order = 1; order <= 4; ++order) {
    const HighOrderMesh mesh = testing::one_cell(GetParam(), order, [](Place p) {
      return Place{2 * p[0] + p[1] + 5, 3 * p[1] - p[2], 4 * p[2]};
    });
    const CellQuality quality = cell_quality(mesh);
    EXPECT_NEAR(quality.scaled_jacobian[0], 1, 1e-11) << "order " << order;
    EXPECT_NEAR(quality.distortion_jacobian[0], 1, 1e-11) << "order " << order;
  }
}

TEST_P(QualityOfShape, TheVectorisedPathAgreesWithOneDeterminantAtATime) {
  const Shape shape = GetParam();
  const int order = 3, intervals = 7;
  const HighOrderMesh mesh = testing::shaken_cells(shape, order, 50, 0.1, 1);
  const int d = mesh.dimension;
  const reference::Points lattice = reference::uniform_lattice(shape, intervals);
  const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, d, lattice);
  const auto straight = reference::basis_gradients(shape, 1, reference::NodeSet::Equispaced, d, lattice);
  const CellQuality quality = cell_quality(mesh, intervals);
  const int nodes = reference::node_count(shape, order);
  for (std::size_t cell = 0; cell < 50; ++cell) {
    const auto jacobian = [&](const std::vector<Eigen::MatrixXd>& gradient, Eigen::Index point) {
      Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(d, d);
      for (Eigen::Index n = 0; n < gradient[0].cols(); ++n)
        for (int c = 0; c < d; ++c)
          for (int r = 0; r < d; ++r)
            matrix(c, r) +=
                mesh.coordinates[(cell * static_cast<std::size_t>(nodes) + static_cast<std::size_t>(n)) * 3 +
                                 static_cast<std::size_t>(c)] *
                gradient[static_cast<std::size_t>(r)](point, n);
      return matrix.determinant();
    };
    double low = 1e300, high = -1e300, distortion_low = 1e300, distortion_high = -1e300;
    for (Eigen::Index point = 0; point < lattice.rows(); ++point) {
      const double j = jacobian(gradients, point);
      const double distortion = j / jacobian(straight, point);
      low = std::min(low, j);
      high = std::max(high, j);
      distortion_low = std::min(distortion_low, distortion);
      distortion_high = std::max(distortion_high, distortion);
    }
    EXPECT_NEAR(quality.scaled_jacobian[cell], low / high, 1e-11);
    EXPECT_NEAR(quality.distortion_jacobian[cell], distortion_low / distortion_high, 1e-11);
  }
}

TEST_P(QualityOfShape, TheNumberOfThreadsDoesNotMatter) {
  const HighOrderMesh mesh = testing::shaken_cells(GetParam(), 2, 300, 0.2, 2);
  const CellQuality one = cell_quality(mesh, 0, 1), two = cell_quality(mesh, 0, 2);
  EXPECT_EQ(one.scaled_jacobian, two.scaled_jacobian);
  EXPECT_EQ(one.distortion_jacobian, two.distortion_jacobian);
}

TEST(Quality, AMeshNumberedClockwiseIsJudgedAsItsMirrorImage) {
  HighOrderMesh mesh = testing::shaken_cells(Shape::Tetrahedron, 3, 20, 0.15, 3);
  const CellQuality before = cell_quality(mesh);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n] *= -1;
  const CellQuality after = cell_quality(mesh);
  for (std::size_t i = 0; i < before.scaled_jacobian.size(); ++i)
    EXPECT_NEAR(before.scaled_jacobian[i], after.scaled_jacobian[i], 1e-13);
  EXPECT_EQ(quality(mesh).clockwise.size(), 20U);
}

TEST(Quality, ATaperedQuadrilateralIsScaledButNotDistorted) {
  // x = ξ (1 + η/2): J = 1 + η/2 goes from 1/2 to 3/2, and the cell is straight-sided.
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 3, [](Place p) {
    return Place{p[0] * (1 + p[1] / 2), p[1], 0};
  });
  const QualityReport report = quality(mesh);
  EXPECT_NEAR(report.min_scaled_jacobian, 1.0 / 3, 1e-12);
  EXPECT_NEAR(report.min_distortion_jacobian, 1, 1e-12);
}

TEST(Quality, TheDistortionOfAValidCellThatIsInvertedWithStraightSidesIsItsScaledJacobian) {
  // A sector of 200 degrees: the straight line between its ends lies on the other side of the centre.
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 8, [](Place p) {
    const double r = 1 + p[0] / 2, angle = p[1] * 100 * std::acos(-1.0) / 180;
    return Place{r * std::cos(angle), r * std::sin(angle), 0};
  });
  const CellQuality quality = cell_quality(mesh);
  EXPECT_NEAR(quality.scaled_jacobian[0], 1.0 / 3, 1e-3);
  EXPECT_EQ(quality.distortion_jacobian[0], quality.scaled_jacobian[0]);
}

TEST(Quality, AnInvalidCellIsNamedWithItsWorstPlace) {
  // J = (1 + 2ξ)(1 + η/2) is least at (−1, 1), −3/2, and greatest at (1, 1), 9/2.
  HighOrderMesh mesh = testing::empty_mesh(Shape::Quadrilateral, 2);
  testing::add_cell(mesh, Shape::Quadrilateral, [](Place p) { return Place{p[0], p[1], 0}; });
  testing::add_cell(mesh, Shape::Quadrilateral, [](Place p) {
    return Place{p[0] + p[0] * p[0], p[1] + p[1] * p[1] / 4, 0};
  });
  mesh.blocks[0].numbers = {70, 71};
  const QualityReport report = quality(mesh);
  ASSERT_EQ(report.invalid_elements, 1);
  EXPECT_EQ(report.invalid[0].number, 71);
  EXPECT_NEAR(report.invalid[0].scaled_jacobian, -1.0 / 3, 1e-12);
  EXPECT_NEAR(report.invalid[0].place[0], 0, 1e-12);
  EXPECT_NEAR(report.invalid[0].place[1], 1.25, 1e-12);
  EXPECT_NEAR(report.mean_scaled_jacobian, (1 - 1.0 / 3) / 2, 1e-12);
  EXPECT_EQ(report.histogram[QualityReport::kBins - 1], 1);
  EXPECT_EQ(std::accumulate(report.histogram.begin(), report.histogram.end(), std::int64_t{0}), 1);
}

TEST(Quality, ACellThatIsNowherePositiveCountsAsMinusOne) {
  // The second triangle is folded over the first, and numbered as a neighbour on the other side of their edge would be.
  HighOrderMesh mesh = testing::empty_mesh(Shape::Triangle, 1);
  mesh.coordinates = {0, 0, 0, 2, 0, 0, 0, 2, 0, 0.5, 0.5, 0};
  mesh.node_numbers = {1, 2, 3, 4};
  ElementBlock& block = mesh.blocks.emplace_back();
  block.shape = Shape::Triangle;
  block.numbers = {1, 2};
  block.nodes = {0, 1, 2, 1, 0, 3};
  EXPECT_EQ(cell_quality(mesh).scaled_jacobian, (std::vector<double>{1, -1}));
  const QualityReport folded = quality(mesh);
  EXPECT_EQ(folded.invalid_elements, 1);
  EXPECT_TRUE(folded.clockwise.empty());
  // With its vertices in another order, it is also clockwise, and as invalid as before.
  std::swap(block.nodes[3], block.nodes[4]);
  EXPECT_EQ(cell_quality(mesh).scaled_jacobian, (std::vector<double>{1, -1}));
  const QualityReport mirrored = quality(mesh);
  EXPECT_EQ(mirrored.invalid_elements, 1);
  EXPECT_EQ(mirrored.clockwise, (std::vector<std::int64_t>{2}));
}

TEST(Quality, CoordinatesFarFromTheOriginKeepTheirDigits) {
  HighOrderMesh mesh = testing::shaken_cells(Shape::Hexahedron, 3, 5, 0.05, 4);
  for (double& x : mesh.coordinates) x = std::round(x * 0x1p30) / 0x1p30;
  const CellQuality before = cell_quality(mesh);
  for (double& x : mesh.coordinates) x += 0x1p15;  // exact: the sum has 45 bits
  EXPECT_EQ(before.scaled_jacobian, cell_quality(mesh).scaled_jacobian);
}

TEST(Quality, ListsWhatIsNotCertified) {
  // J = (1 + 2ξ)(1 + η/2) is negative for ξ < −1/2.
  HighOrderMesh mesh = testing::empty_mesh(Shape::Quadrilateral, 2);
  testing::add_cell(mesh, Shape::Quadrilateral, [](Place p) { return Place{p[0], p[1], 0}; });
  testing::add_cell(mesh, Shape::Quadrilateral, [](Place p) {
    return Place{p[0] + p[0] * p[0], p[1] + p[1] * p[1] / 4, 0};
  });
  mesh.blocks[0].numbers = {70, 71};
  const QualityReport report = quality(mesh);
  EXPECT_EQ(report.certified.valid, 1);
  EXPECT_EQ(report.certified.invalid, 1);
  ASSERT_EQ(report.uncertified.size(), 1U);
  EXPECT_EQ(report.uncertified[0].answer, Certificate::Answer::Invalid);
  EXPECT_EQ(uncertified_numbers(report), (std::vector<std::int64_t>{71}));
}

TEST(Quality, OfACertifiedMeshIsTheSameWithoutCertifyingAgain) {
  const HighOrderMesh mesh = testing::shaken_cells(Shape::Hexahedron, 2, 20, 0.15, 5);
  const Team team(1);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  const QualityReport plain = quality(mesh), again = quality(mesh, certifier, certificates, 0, team);
  EXPECT_EQ(again.min_scaled_jacobian, plain.min_scaled_jacobian);
  EXPECT_EQ(again.mean_scaled_jacobian, plain.mean_scaled_jacobian);
  EXPECT_EQ(again.histogram, plain.histogram);
  EXPECT_EQ(again.certified.valid, plain.certified.valid);
  EXPECT_EQ(again.certified.min_scaled_jacobian_lower_bound, plain.certified.min_scaled_jacobian_lower_bound);
}

TEST(Quality, SamplesAsManyIntervalsAsTheOrderAsksFor) {
  const auto intervals = [](int order) {
    return quality(testing::one_cell(Shape::Triangle, order, [](Place p) { return p; })).lattice_intervals;
  };
  EXPECT_EQ(intervals(1), 8);
  EXPECT_EQ(intervals(3), 8);
  EXPECT_EQ(intervals(5), 12);
}

}  // namespace
}  // namespace varimesh
