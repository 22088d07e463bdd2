// J on a lattice: cells whose J is known, and lanes that do not disturb each other.
#include "core/quality/lattice_kernel.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

using testing::Place;

std::vector<Extremes> sampled(const HighOrderMesh& mesh, int intervals) {
  const ElementBlock& block = mesh.blocks[0];
  const LatticeTable& table = lattice_table(block.shape, block.order, intervals, mesh.dimension);
  std::vector<const std::int32_t*> nodes;
  for (std::size_t e = 0; e < block.size(); ++e) nodes.push_back(block.nodes.data() + e * std::size_t(table.nodes()));
  std::vector<Extremes> out(block.size());
  std::vector<double> workspace;
  LatticeRows made;
  LatticeProgress progress;
  for (std::size_t range = 0; range < table.ranges(); ++range)
    sample_rows(table, table.rows(range, made), {mesh.coordinates.data(), nodes.data(), nodes.size()}, workspace,
                progress);
  finish_samples(table, progress, nodes.size(), out.data());
  return out;
}

TEST(LatticeTable, HasTheLatticesPoints) {
  const LatticeTable& table = lattice_table(Shape::Quadrilateral, 3, 4, 2);
  EXPECT_EQ(table.dimension(), 2);
  EXPECT_EQ(table.nodes(), 16);
  EXPECT_EQ(table.vertices(), 4);
  EXPECT_EQ(table.points().rows(), 25);
  EXPECT_EQ(lattice_table(Shape::Triangle, 3, 4, 2).vertices(), 0) << "the straight-sided triangle's J is constant";
}

TEST(LatticeTable, IsMadeOnce) {
  EXPECT_EQ(&lattice_table(Shape::Prism, 2, 6, 3), &lattice_table(Shape::Prism, 2, 6, 3));
  EXPECT_NE(&lattice_table(Shape::Prism, 2, 6, 3), &lattice_table(Shape::Prism, 2, 5, 3));
}

TEST(LatticeTable, MakesLargeRowsInRanges) {
  // 17³ points and 343 nodes: 40 MB in one piece.
  constexpr int kOrder = 6, kIntervals = 16;
  const LatticeTable& table = lattice_table(Shape::Hexahedron, kOrder, kIntervals, 3);
  ASSERT_GT(table.ranges(), 1U);
  const reference::Points points = reference::uniform_lattice(Shape::Hexahedron, kIntervals);
  const auto whole = reference::basis_gradients(Shape::Hexahedron, kOrder, reference::NodeSet::Equispaced, 3, points);
  LatticeRows made;
  std::size_t next = 0;
  for (std::size_t range = 0; range < table.ranges(); ++range) {
    const LatticeRows& rows = table.rows(range, made);
    ASSERT_EQ(rows.first, next);
    EXPECT_LE(rows.gradients.size() * sizeof(double), std::size_t{4} << 20);
    for (std::size_t p = 0; p < rows.count; p += 7)
      for (std::size_t n = 0; n < 343; ++n)
        for (std::size_t r = 0; r < 3; ++r)
          ASSERT_EQ(rows.gradients[(p * 343 + n) * 3 + r], whole[r](Eigen::Index(rows.first + p), Eigen::Index(n)));
    next += rows.count;
  }
  EXPECT_EQ(next, std::size_t(points.rows()));
}

TEST(SampleOnLattice, FindsTheExtremesOfATaperedQuadrilateral) {
  // x = ξ (1 + η/2): J = 1 + η/2, from 1/2 at η = −1 to 3/2 at η = 1.
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 2, [](Place p) {
    return Place{p[0] * (1 + p[1] / 2), p[1], 0};
  });
  const Extremes found = sampled(mesh, 4)[0];
  const reference::Points points = lattice_table(Shape::Quadrilateral, 2, 4, 2).points();
  EXPECT_NEAR(found.low, 0.5, 1e-14);
  EXPECT_NEAR(found.high, 1.5, 1e-14);
  EXPECT_NEAR(found.mean, 1, 1e-14);
  EXPECT_EQ(points(found.low_at, 1), -1);
  EXPECT_EQ(points(found.high_at, 1), 1);
  EXPECT_NEAR(found.distortion_low, 1, 1e-13) << "it is straight-sided";
  EXPECT_NEAR(found.distortion_high, 1, 1e-13);
}

TEST(SampleOnLattice, FindsTheSameExtremesInRangesAsCellByCell) {
  const HighOrderMesh mesh = testing::shaken_cells(Shape::Hexahedron, 6, 1, 0.02, 1);
  const Extremes found = sampled(mesh, 16)[0];
  const reference::Points points = reference::uniform_lattice(Shape::Hexahedron, 16);
  const auto gradients = reference::basis_gradients(Shape::Hexahedron, 6, reference::NodeSet::Equispaced, 3, points);
  Eigen::MatrixXd x(343, 3);
  for (int n = 0; n < 343; ++n)
    for (int c = 0; c < 3; ++c)
      x(n, c) = mesh.coordinates[3 * std::size_t(mesh.blocks[0].nodes[std::size_t(n)]) + std::size_t(c)];
  double low = 1e300, high = -1e300;
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    Eigen::Matrix3d slopes;
    for (std::size_t r = 0; r < 3; ++r) slopes.row(Eigen::Index(r)) = gradients[r].row(p) * x;
    low = std::min(low, slopes.determinant());
    high = std::max(high, slopes.determinant());
  }
  EXPECT_NEAR(found.low, low, 1e-11);
  EXPECT_NEAR(found.high, high, 1e-11);
}

TEST(SampleOnLattice, KeepsTheSignOfAnInvertedCell) {
  const HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](Place p) { return Place{-p[0], p[1], p[2]}; });
  const Extremes found = sampled(mesh, 3)[0];
  EXPECT_NEAR(found.low, -1, 1e-13);
  EXPECT_NEAR(found.high, -1, 1e-13);
}

TEST(SampleOnLattice, GivesEachLaneItsOwnCell) {
  for (const Shape shape : testing::kCellShapes) {
    const auto lanes = int(lattice_lanes());
    ASSERT_LE(lanes, int(kMostLatticeLanes));
    const HighOrderMesh mesh = testing::shaken_cells(shape, 3, lanes, 0.1, 1);
    const std::vector<Extremes> together = sampled(mesh, 5);
    for (std::size_t cell = 0; cell < std::size_t(lanes); ++cell) {
      HighOrderMesh alone = mesh;
      const std::size_t nodes = mesh.blocks[0].nodes.size() / std::size_t(lanes);
      alone.blocks[0].numbers = {1};
      alone.blocks[0].nodes.assign(mesh.blocks[0].nodes.begin() + std::ptrdiff_t(cell * nodes),
                                   mesh.blocks[0].nodes.begin() + std::ptrdiff_t((cell + 1) * nodes));
      const Extremes one = sampled(alone, 5)[0];
      EXPECT_EQ(one.low, together[cell].low);
      EXPECT_EQ(one.high, together[cell].high);
      EXPECT_EQ(one.mean, together[cell].mean);
      EXPECT_EQ(one.low_at, together[cell].low_at);
      EXPECT_EQ(one.distortion_low, together[cell].distortion_low);
    }
  }
}

}  // namespace
}  // namespace varimesh::detail
