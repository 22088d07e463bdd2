// Which groups of tetrahedra have little room, which splits give them some, and what may be split.
#include "core/repair/split_candidates.h"

#include <gtest/gtest.h>

#include "core/repair/choose_splits.h"
#include "core/repair/split_passes.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

std::vector<WeakGroup> weak(const HighOrderMesh& mesh) {
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const SplitRules rules(mesh, cells, fixed);
  const WeakRule rule{0.08, std::vector<bool>(cells.count(), true), {}};
  const Team team(1);
  std::vector<WeakGroup> groups;
  team.run([&] { groups = weak_groups(mesh, fixed, rules, rule, team); });
  return groups;
}

TEST(WeakGroups, WantTheDiagonalOfSixInABall) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const std::vector<WeakGroup> groups = weak(mesh);
  ASSERT_GE(groups.size(), 6u);  // each of the six has two faces in one sphere
  for (const WeakGroup& group : groups) {
    EXPECT_LE(group.margin, 0.08);
    ASSERT_FALSE(group.candidates.empty());
  }
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const SplitRules rules(mesh, cells, fixed);
  EXPECT_EQ(choose_splits(groups, rules), (std::vector<SplitPlace>{{0, 7, -1}}));
  EXPECT_EQ(rules.cells_around({0, 7, -1}), (std::vector<std::int32_t>{0, 1, 2, 3, 4, 5}));
}

TEST(WeakGroups, WantTheFaceIfItsEdgesAreOnTheBoundary) {
  const HighOrderMesh mesh = testing::two_in_a_ball(3);
  const std::vector<WeakGroup> groups = weak(mesh);
  ASSERT_FALSE(groups.empty());
  for (const WeakGroup& group : groups) EXPECT_EQ(group.candidates, (std::vector<SplitPlace>{{0, 1, 2}}));
}

TEST(WeakGroups, AreGoneAfterTheSplit) {
  const SplitPlace diagonal{0, 7, -1};
  std::vector<RepairStep> steps;
  EXPECT_TRUE(weak(split(testing::six_in_a_ball(3), std::span(&diagonal, 1), steps)).empty());
}

TEST(SplitRules, SpareFixedPlacesAndThoseWithAnElement) {
  HighOrderMesh mesh = testing::six_in_a_ball(3);
  std::vector<bool> fixed = fixed_nodes(mesh);
  {
    const Cells cells(mesh, 3);
    EXPECT_TRUE(SplitRules(mesh, cells, fixed).may_split({0, 7, -1}));
    EXPECT_FALSE(SplitRules(mesh, cells, fixed).may_split({0, 3, -1}));  // on the boundary
    std::vector<bool> held = fixed;
    for (std::size_t n = 0; n < mesh.node_count(); ++n) held[n] = true;
    EXPECT_FALSE(SplitRules(mesh, cells, held).may_split({0, 7, -1}));
  }
  // A line element on the diagonal, with the nodes of the first cell's edge.
  ElementBlock line;
  line.shape = Shape::Line;
  line.order = 3;
  line.numbers = {200};
  line.nodes = {0, 7};
  const auto& places = reference::node_places(Shape::Tetrahedron, 3);
  for (std::size_t n = 0; n < places.size(); ++n)
    if (places[n].dimension == 1 && places[n].index == 3) line.nodes.push_back(mesh.blocks[0].nodes[n]);
  mesh.blocks.push_back(line);
  const Cells cells(mesh, 3);
  EXPECT_FALSE(SplitRules(mesh, cells, fixed).may_split({0, 7, -1}));
}

TEST(SplitRules, SpareEdgesThatOtherShapesShare) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::MixedSolid, {5, 2, 2}, 2);
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const SplitRules rules(mesh, cells, fixed);
  const auto vertices = [&](std::size_t cell) {
    return cells.nodes(cell).first(static_cast<std::size_t>(reference::info(cells.shape(cell)).vertices));
  };
  int splittable = 0;
  for (std::size_t tetrahedron = 0; tetrahedron < cells.count(); ++tetrahedron) {
    if (cells.shape(tetrahedron) != Shape::Tetrahedron) continue;
    for (const auto& edge : reference::info(Shape::Tetrahedron).edges) {
      const auto [a, b] = std::minmax(vertices(tetrahedron)[static_cast<std::size_t>(edge[0])],
                                      vertices(tetrahedron)[static_cast<std::size_t>(edge[1])]);
      bool shared = false;
      for (std::size_t cell = 0; cell < cells.count(); ++cell)
        shared = shared || (cells.shape(cell) != Shape::Tetrahedron &&
                            std::ranges::count(vertices(cell), a) + std::ranges::count(vertices(cell), b) == 2);
      const bool may = rules.may_split({a, b, -1});
      EXPECT_FALSE(shared && may) << a << " " << b;
      splittable += may ? 1 : 0;
    }
  }
  EXPECT_GT(splittable, 0);
}

TEST(SplitRules, SpareFlatCells) {
  HighOrderMesh mesh = testing::six_in_a_ball(2);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n + 2] *= 1e-5;
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  EXPECT_FALSE(SplitRules(mesh, cells, fixed).may_split({0, 7, -1}));
}

TEST(SplitPasses, SplitOnlyForWantedElements) {
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const StopToken never;
  std::vector<RepairStep> steps;
  split_in_passes(mesh, Options(), {}, {}, steps, never);
  EXPECT_TRUE(steps.empty());
  const Cells cells(mesh, 3);
  std::vector<std::int64_t> all;
  for (std::size_t c = 0; c < cells.count(); ++c) all.push_back(cells.number(c));
  std::ranges::sort(all);
  split_in_passes(mesh, Options(), all, {}, steps, never);
  EXPECT_FALSE(steps.empty());
}

}  // namespace
}  // namespace varimesh
