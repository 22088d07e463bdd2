// J on a lattice: cells whose J is known, and lanes that do not disturb each other.
#include "core/quality/lattice_kernel.h"

#include <gtest/gtest.h>

#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

using testing::Place;

std::vector<Extremes> sampled(const HighOrderMesh& mesh, int intervals) {
  const ElementBlock& block = mesh.blocks[0];
  const LatticeTable table = lattice_table(block.shape, block.order, intervals, mesh.dimension);
  std::vector<const std::int32_t*> nodes;
  for (std::size_t e = 0; e < block.size(); ++e) nodes.push_back(block.nodes.data() + e * std::size_t(table.nodes));
  std::vector<Extremes> out(block.size());
  std::vector<double> workspace;
  sample_on_lattice(table, mesh.coordinates.data(), nodes.data(), nodes.size(), workspace, out.data());
  return out;
}

TEST(LatticeTable, HasTheLatticesPoints) {
  const LatticeTable table = lattice_table(Shape::Quadrilateral, 3, 4, 2);
  EXPECT_EQ(table.dimension, 2);
  EXPECT_EQ(table.nodes, 16);
  EXPECT_EQ(table.vertices, 4);
  EXPECT_EQ(table.points.rows(), 25);
  EXPECT_EQ(lattice_table(Shape::Triangle, 3, 4, 2).vertices, 0) << "the straight-sided triangle's J is constant";
}

TEST(SampleOnLattice, FindsTheExtremesOfATaperedQuadrilateral) {
  // x = ξ (1 + η/2): J = 1 + η/2, from 1/2 at η = −1 to 3/2 at η = 1.
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 2, [](Place p) {
    return Place{p[0] * (1 + p[1] / 2), p[1], 0};
  });
  const Extremes found = sampled(mesh, 4)[0];
  const reference::Points points = lattice_table(Shape::Quadrilateral, 2, 4, 2).points;
  EXPECT_NEAR(found.low, 0.5, 1e-14);
  EXPECT_NEAR(found.high, 1.5, 1e-14);
  EXPECT_NEAR(found.mean, 1, 1e-14);
  EXPECT_EQ(points(found.low_at, 1), -1);
  EXPECT_EQ(points(found.high_at, 1), 1);
  EXPECT_NEAR(found.distortion_low, 1, 1e-13) << "it is straight-sided";
  EXPECT_NEAR(found.distortion_high, 1, 1e-13);
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
