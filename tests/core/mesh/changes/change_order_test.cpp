// Raising and lowering the order is exact and keeps the mesh conforming. Everything but the nodes is carried over.
#include "core/mesh/changes/change_order.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "core/mesh/check.h"
#include "core/quality/quality.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

class ChangeOrder : public ::testing::TestWithParam<Filling> {};
INSTANTIATE_TEST_SUITE_P(EveryFilling, ChangeOrder, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& p) { return testing::name(p.param); });

HighOrderMesh bent_grid(Filling filling, int order) {
  return testing::grid(filling, {3, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
}

TEST_P(ChangeOrder, RaisedMeshesPassEveryCheck) {
  for (const int order : {1, 2, 3, 4, 7, 10}) {
    const HighOrderMesh mesh = bent_grid(GetParam(), order);
    EXPECT_EQ(mesh.order, order);
    const auto checked = check_structure(mesh);
    EXPECT_TRUE(checked) << "order " << order << ": " << (checked ? "" : checked.error().sentence);
  }
}

TEST_P(ChangeOrder, RaisedLinearCellsAreStraightSided) {
  const QualityReport report = quality(bent_grid(GetParam(), 4));
  EXPECT_EQ(report.invalid_elements, 0);
  EXPECT_NEAR(report.min_distortion_jacobian, 1, 1e-10);
}

TEST_P(ChangeOrder, LoweringUndoesRaising) {
  HighOrderMesh mesh = bent_grid(GetParam(), 3);
  testing::shake(mesh, 0.01, 1);
  const auto raised = change_order(mesh, 5);
  ASSERT_TRUE(raised);
  const auto lowered = change_order(*raised, 3);
  ASSERT_TRUE(lowered);
  // New nodes have new numbers but are in the same order in each cell.
  std::map<std::int32_t, std::int32_t> partner;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    for (std::size_t i = 0; i < mesh.blocks[b].nodes.size(); ++i)
      partner[mesh.blocks[b].nodes[i]] = lowered->blocks[b].nodes[i];
  EXPECT_EQ(lowered->node_count(), mesh.node_count());
  for (const auto& [a, b] : partner)
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(mesh.coordinates[std::size_t(3 * a + k)], lowered->coordinates[std::size_t(3 * b + k)], 1e-13);
}

TEST_P(ChangeOrder, VerticesKeepNumbersAndCoordinates) {
  const HighOrderMesh mesh = bent_grid(GetParam(), 2);
  const auto raised = change_order(mesh, 3);
  ASSERT_TRUE(raised);
  const std::vector<bool> vertex = testing::vertex_nodes(mesh);
  const std::vector<bool> vertex_after = testing::vertex_nodes(*raised);
  const std::int64_t largest = *std::max_element(mesh.node_numbers.begin(), mesh.node_numbers.end());
  std::map<std::int64_t, Place> before;
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (vertex[n])
      before[mesh.node_numbers[n]] = {mesh.coordinates[3 * n], mesh.coordinates[3 * n + 1],
                                      mesh.coordinates[3 * n + 2]};
  std::size_t kept = 0;
  for (std::size_t n = 0; n < raised->node_count(); ++n) {
    if (!vertex_after[n]) {
      EXPECT_GT(raised->node_numbers[n], largest);
      continue;
    }
    ++kept;
    const Place at{raised->coordinates[3 * n], raised->coordinates[3 * n + 1], raised->coordinates[3 * n + 2]};
    EXPECT_EQ(before.at(raised->node_numbers[n]), at);
  }
  EXPECT_EQ(kept, before.size());
  EXPECT_EQ(std::set<std::int64_t>(raised->node_numbers.begin(), raised->node_numbers.end()).size(),
            raised->node_count());
}

TEST_P(ChangeOrder, ElementsAndGroupsCarryOver) {
  const HighOrderMesh mesh = bent_grid(GetParam(), 1);
  const auto raised = change_order(mesh, 2);
  ASSERT_TRUE(raised);
  ASSERT_EQ(raised->blocks.size(), mesh.blocks.size());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    EXPECT_EQ(raised->blocks[b].shape, mesh.blocks[b].shape);
    EXPECT_EQ(raised->blocks[b].order, 2);
    EXPECT_EQ(raised->blocks[b].numbers, mesh.blocks[b].numbers);
    EXPECT_EQ(raised->blocks[b].physical, mesh.blocks[b].physical);
  }
  EXPECT_EQ(raised->physical_groups.size(), mesh.physical_groups.size());
}

TEST(ChangeOrderOfAMesh, NodeBlocksCoverNewNodesOnTheLowestEntity) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 1);
  mesh.node_blocks = {{2, 1, 0, std::int32_t(mesh.node_count())}};
  const auto raised = change_order(mesh, 3);
  ASSERT_TRUE(raised);
  std::int32_t next = 0;
  std::map<std::pair<int, int>, int> counts;
  for (const NodeBlock& block : raised->node_blocks) {
    EXPECT_EQ(block.first, next);
    next += block.count;
    counts[{block.dimension, block.entity}] += block.count;
  }
  EXPECT_EQ(std::size_t(next), raised->node_count());
  for (int side = 1; side <= 4; ++side) EXPECT_EQ((counts[{1, side}]), 2 * 2) << side;
  EXPECT_EQ((counts[{2, 1}]), 9 + 8 * 2 + 8);
}

TEST(ChangeOrderOfAMesh, PeriodicLinksTakeInNewNodes) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 1);
  PeriodicLink link{2, 2, 1, {}, {}};
  for (const std::int32_t node : testing::side_nodes(mesh, 2)) link.nodes.emplace_back(node, node - 2);
  mesh.periodic.push_back(link);
  const auto raised = change_order(mesh, 4);
  ASSERT_TRUE(raised);
  ASSERT_EQ(raised->periodic.size(), 1u);
  EXPECT_EQ(raised->periodic[0].nodes.size(), testing::side_nodes(*raised, 2).size());
  for (const auto& [a, b] : raised->periodic[0].nodes) {
    EXPECT_NEAR(raised->coordinates[std::size_t(3 * a)], raised->coordinates[std::size_t(3 * b)] + 1, 1e-14);
    for (int k = 1; k < 3; ++k)
      EXPECT_NEAR(raised->coordinates[std::size_t(3 * a + k)], raised->coordinates[std::size_t(3 * b + k)], 1e-14);
  }
}

TEST(ChangeOrderOfAMesh, SameOrderIsVerbatim) {
  HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {2, 1, 1}, 3);
  testing::shake(mesh, 0.01, 3);
  const auto same = change_order(mesh, 3);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->coordinates, mesh.coordinates);
  EXPECT_EQ(same->node_numbers, mesh.node_numbers);
}

TEST(ChangeOrderOfAMesh, RefusesOrdersOutOfRange) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {1, 1, 0}, 1);
  for (const int order : {-1, 0, 11}) {
    const auto refused = change_order(mesh, order);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, Error::Kind::BadOption);
    EXPECT_NE(refused.error().sentence.find(std::to_string(order)), std::string::npos);
  }
}

}  // namespace
}  // namespace varimesh
