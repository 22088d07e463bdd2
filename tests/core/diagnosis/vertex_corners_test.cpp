// The fixed vertices of a mesh, with the directions and corners of the cells around them.
#include "core/diagnosis/vertex_corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh::detail {
namespace {

using testing::Filling;
using testing::Place;

/// The link of that node.
VertexCorners::Link link_of(const VertexCorners& corners, std::int32_t node) {
  for (std::size_t i = 0; i < corners.vertices(); ++i)
    if (VertexCorners::Link link = corners.link(i); link.node == node) return link;
  ADD_FAILURE() << "node " << node << " has no link";
  return {};
}

TEST(VertexCorners, KnowTheFixedVerticesOnly) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {3, 3, 3}, 2);
  const std::vector<bool> fixed = fixed_nodes(mesh), vertex = testing::vertex_nodes(mesh);
  const Cells cells(mesh, 3);
  const VertexCorners corners(mesh, cells, fixed, 1);
  EXPECT_EQ(corners.vertices(), 64U - 8U) << "eight vertices are inside";
  for (std::size_t i = 0; i < corners.vertices(); ++i) {
    const auto node = std::size_t(corners.link(i).node);
    EXPECT_TRUE(fixed[node] && vertex[node]);
  }
}

TEST(VertexCorners, CountTheCellsAndEdgesOfACube) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 2, 2}, 3);
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const VertexCorners corners(mesh, cells, fixed, 1);
  // Corner, edge and face of the cube: one, two and four cells with three, four and five edges.
  const std::pair<std::size_t, std::size_t> expected[] = {{1, 3}, {2, 4}, {4, 5}};
  for (std::size_t i = 0; i < corners.vertices(); ++i) {
    const VertexCorners::Link link = corners.link(i);
    const double* x = mesh.coordinates.data() + 3 * link.node;
    const auto inner = std::count(x, x + 3, 0.5);
    ASSERT_LT(inner, 3);
    EXPECT_EQ(link.corners.size(), expected[inner].first);
    EXPECT_EQ(link.directions.size(), expected[inner].second);
    EXPECT_EQ(link.ends.size(), link.directions.size());
  }
}

TEST(VertexCorners, TakeTangentsOfCurvedEdges) {
  // The edge from vertex 0 along ξ is x = (t, t², 0) with t = ξ + 1: its tangent there is (1, 0, 0).
  const HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 3, [](Place p) {
    const double t = p[0] + 1;
    return Place{t, p[1] + 1 + t * t, p[2] + 1 + 2 * t * (p[1] + 1)};
  });
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed(mesh.node_count(), true);
  const VertexCorners corners(mesh, cells, fixed, 1);
  const VertexCorners::Link link = link_of(corners, 0);
  ASSERT_EQ(link.directions.size(), 3U);
  const auto along = std::size_t(std::ranges::find(link.ends, 1) - link.ends.begin());
  EXPECT_NEAR(link.directions[along].unit[0], 1, 1e-12);
  EXPECT_NEAR(link.directions[along].unit[1], 0, 1e-12);
  EXPECT_TRUE(link.directions[along].fixed);
  // At its other end, t = 2, the tangent points back along −(1, 4, 0).
  const VertexCorners::Link other = link_of(corners, 1);
  const auto back = std::size_t(std::ranges::find(other.ends, 0) - other.ends.begin());
  EXPECT_NEAR(other.directions[back].unit[0], -1 / std::sqrt(17.0), 1e-12);
  EXPECT_NEAR(other.directions[back].unit[1], -4 / std::sqrt(17.0), 1e-12);
}

TEST(VertexCorners, CallAnEdgeFreeIfOneOfItsNodesIs) {
  const HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](Place p) { return p; });
  std::vector<bool> fixed(mesh.node_count(), true);
  fixed[4] = false;  // in the middle of the edge between vertices 0 and 1
  const Cells cells(mesh, 3);
  const VertexCorners::Link link = link_of(VertexCorners(mesh, cells, fixed, 1), 0);
  for (std::size_t i = 0; i < link.ends.size(); ++i) EXPECT_EQ(link.directions[i].fixed, link.ends[i] != 1);
}

TEST(VertexCorners, GoRoundEveryCornerSoThatTheCellIsInside) {
  for (const Filling filling : {Filling::Hexahedra, Filling::Prisms, Filling::Tetrahedra, Filling::Pyramids})
    for (const bool mirrored : {false, true}) {
      HighOrderMesh mesh = testing::grid(filling, {2, 2, 2}, 2);
      if (mirrored)
        for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n] *= -1;
      const Cells cells(mesh, 3);
      const std::vector<bool> fixed(mesh.node_count(), true);
      const VertexCorners corners(mesh, cells, fixed, mirrored ? -1 : 1);
      for (std::size_t i = 0; i < corners.vertices(); ++i) {
        const VertexCorners::Link link = corners.link(i);
        for (const LinkCorner& corner : link.corners) {
          const auto direction = [&](std::size_t k) { return link.directions[std::size_t(corner.direction[k])].unit; };
          EXPECT_GT(determinant(direction(0), direction(1), direction(2)), 0);
        }
      }
    }
}

}  // namespace
}  // namespace varimesh::detail
