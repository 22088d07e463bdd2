// Points where J depends on fixed nodes only, and flat facets that fold.
#include "core/diagnosis/fixed_samples.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

using testing::Place;

/// A tetrahedron of order 4 whose first edge folds: J = 1 − 1.2 t (2 − t) there, with t = ξ + 1.
HighOrderMesh folded_edge() {
  return testing::one_cell(Shape::Tetrahedron, 4, [](Place p) {
    const double t = p[0] + 1;
    return Place{p[0], (p[1] + 1) * (1 - 1.2 * t * (2 - t)), p[2] + 1};
  });
}

TEST(FixedSamples, FindTheWorstPointOfAnEdgeBetweenTwoFixedFaces) {
  const HighOrderMesh mesh = folded_edge();
  const Cells cells(mesh, 3);
  const auto found = FixedSamples(mesh, cells).worst(0, std::vector<bool>(mesh.node_count(), true), 1);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].dimension, 1) << "vertices are left to the vertex condition";
  // J is least in the middle, −0.2, and largest at the ends, 1.
  EXPECT_NEAR(found[0].jacobian, -0.2, 1e-12);
  EXPECT_NEAR(found[0].place[0], 0, 1e-12);
}

TEST(FixedSamples, AskForTwoFixedFaces) {
  const HighOrderMesh mesh = folded_edge();
  const Cells cells(mesh, 3);
  std::vector<bool> fixed(mesh.node_count(), false);
  for (const int node : reference::facet_nodes(Shape::Tetrahedron, 4, 0)) fixed[std::size_t(node)] = true;
  EXPECT_TRUE(FixedSamples(mesh, cells).worst(0, fixed, 1).empty());
}

TEST(FixedSamples, FindNothingInAValidCell) {
  const HighOrderMesh mesh = testing::shaken_cells(Shape::Prism, 3, 5, 0.01, 1);
  const Cells cells(mesh, 3);
  const FixedSamples samples(mesh, cells);
  for (std::size_t cell = 0; cell < 5; ++cell)
    EXPECT_TRUE(samples.worst(cell, std::vector<bool>(mesh.node_count(), true), 1).empty());
}

TEST(FixedSamples, JudgeAClockwiseMeshAsItsMirrorImage) {
  HighOrderMesh mesh = folded_edge();
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n + 2] *= -1;
  const Cells cells(mesh, 3);
  const auto found = FixedSamples(mesh, cells).worst(0, std::vector<bool>(mesh.node_count(), true), -1);
  ASSERT_FALSE(found.empty());
  EXPECT_NEAR(found[0].jacobian, -0.2, 1e-12);
}

TEST(FixedSamples, FindTheVertexOfATriangle) {
  // With this middle node, the first edge leaves vertex 0 on the wrong side of the third edge.
  HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](Place p) { return p; });
  mesh.coordinates[9] = -1.2;
  mesh.coordinates[10] = 0.4;
  const Cells cells(mesh, 2);
  const auto found = FixedSamples(mesh, cells).worst(0, std::vector<bool>(mesh.node_count(), true), 1);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].dimension, 0);
  EXPECT_EQ(found[0].vertex, 0);
  EXPECT_LT(found[0].jacobian, 0);
}

/// A tetrahedron of order 2 with the middle of its first edge moved by this much.
HighOrderMesh with_middle_moved(Place by) {
  HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](Place p) { return p; });
  for (std::size_t c = 0; c < 3; ++c) mesh.coordinates[3 * 4 + c] += by[c];
  return mesh;
}

std::vector<FixedSample> folded_in(const HighOrderMesh& mesh) {
  const Cells cells(mesh, mesh.dimension);
  return FoldedFacets(mesh, cells).in(0, std::vector<bool>(mesh.node_count(), true));
}

TEST(FoldedFacets, FindAFlatFaceThatFolds) {
  // The middle of an edge moves within the plane of a face past the face's own middle.
  const auto found = folded_in(with_middle_moved({0, 1.2, 0}));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].dimension, 2);
  EXPECT_LT(found[0].jacobian, 0);
  EXPECT_NEAR(found[0].place[2], -1, 1e-12) << "in the plane of the face";
}

TEST(FoldedFacets, FindACurvedFaceThatFoldsAndSayHowMuchRoomItLeaves) {
  // The same, but the middle also leaves the plane, so that the normal turns and vanishes nowhere.
  const auto found = folded_in(with_middle_moved({0, 1.2, -0.01}));
  ASSERT_FALSE(found.empty());
  EXPECT_GT(found[0].jacobian, 0);
  EXPECT_LT(found[0].jacobian, 0.3);
}

TEST(FoldedFacets, LeaveAFaceThatBulgesOrBendsALittle) {
  EXPECT_TRUE(folded_in(with_middle_moved({0, 0, -2})).empty());
  EXPECT_TRUE(folded_in(with_middle_moved({0, 0.2, 0})).empty());
}

TEST(FoldedFacets, FindAStraightEdgeThatFolds) {
  // x = ξ + 0.8 (1 − ξ²) on the first edge: dx/dξ = 1 − 1.6 ξ is negative from ξ = 5/8 on.
  HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](Place p) { return p; });
  mesh.coordinates[9] = 0.8;
  const auto found = folded_in(mesh);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].dimension, 1);
  EXPECT_NEAR(found[0].jacobian, -0.6 / 2.6, 1e-12) << "the least over the largest derivative";
  EXPECT_NEAR(found[0].place[0], 1, 1e-12);
}

}  // namespace
}  // namespace varimesh::detail
