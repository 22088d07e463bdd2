// Margins that are known by symmetry, and what may be split.
#include "core/diagnosis/link_margin.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/repair/choose_splits.h"
#include "core/repair/split_candidates.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using detail::determinant;
using detail::dot;
using detail::LinkCorner;
using detail::LinkDirection;
using detail::LinkPiece;
using detail::Vector;

constexpr double kEnough = 0.08;

Vector unit(Vector x) {
  const double length = std::sqrt(dot(x, x));
  for (double& c : x) c /= length;
  return x;
}

/// Fixed directions round the z axis, h high, and a free one at `start`.
std::vector<LinkDirection> cone(int count, double h, const Vector& start) {
  std::vector<LinkDirection> directions;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * M_PI * i / count;
    directions.push_back({unit({std::cos(angle), std::sin(angle), h}), true});
  }
  directions.push_back({unit(start), false});
  return directions;
}

std::vector<LinkCorner> fan(std::int32_t count) {
  std::vector<LinkCorner> corners;
  for (std::int32_t i = 0; i < count; ++i) corners.push_back({i, {i, (i + 1) % count, count, -1}});
  return corners;
}

TEST(LinkMarginTest, TurnsTheFreeDirectionToTheMiddle) {
  const auto directions = cone(5, 0.7, {0.9, 0.3, 0.4});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(5), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_EQ(pieces[0].corners.size(), 5u);
  EXPECT_EQ(pieces[0].fence.size(), 5u);
  // All corners alike when it points along the axis.
  const double best = determinant(directions[0].unit, directions[1].unit, {0, 0, 1});
  EXPECT_NEAR(pieces[0].margin, best, 1e-9);
}

TEST(LinkMarginTest, IsTheDeterminantOfAFenceOfThree) {
  const auto directions = cone(3, 0.02, {0, 0, 1});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(3), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_NEAR(pieces[0].margin, determinant(directions[0].unit, directions[1].unit, directions[2].unit), 1e-12);
  EXPECT_LT(pieces[0].margin, 0.06);
}

TEST(LinkMarginTest, FindsNoRoomRoundAFoldedFence) {
  // The fourth direction lies on the wrong side of its neighbours.
  auto directions = cone(4, 0.5, {0, 0, 1});
  directions[3].unit = unit({0.9, 0.1, 0.5});
  directions[0].unit = unit({0.2, -0.9, 0.5});
  const std::vector<LinkPiece> pieces = detail::link_pieces(directions, fan(4), kEnough);
  ASSERT_EQ(pieces.size(), 1u);
  EXPECT_LE(pieces[0].margin, 0);
}

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

TEST(WeakGroupsTest, WantTheDiagonalOfSixInABall) {
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

TEST(WeakGroupsTest, WantTheFaceWhereItsEdgesAreOnTheBoundary) {
  const HighOrderMesh mesh = testing::two_in_a_ball(3);
  const std::vector<WeakGroup> groups = weak(mesh);
  ASSERT_FALSE(groups.empty());
  for (const WeakGroup& group : groups) EXPECT_EQ(group.candidates, (std::vector<SplitPlace>{{0, 1, 2}}));
}

TEST(WeakGroupsTest, AreGoneAfterTheSplit) {
  const SplitPlace diagonal{0, 7, -1};
  std::vector<RepairStep> steps;
  EXPECT_TRUE(weak(split(testing::six_in_a_ball(3), std::span(&diagonal, 1), steps)).empty());
}

TEST(SplitRulesTest, SpareWhatIsFixedOrHasAnElement) {
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
  // A line element on the diagonal: its nodes are those of the first cell's edge.
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

TEST(SplitRulesTest, SpareWhatOtherShapesShare) {
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

TEST(SplitRulesTest, SpareFlatCells) {
  HighOrderMesh mesh = testing::six_in_a_ball(2);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n + 2] *= 1e-5;
  const Cells cells(mesh, 3);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  EXPECT_FALSE(SplitRules(mesh, cells, fixed).may_split({0, 7, -1}));
}

}  // namespace
}  // namespace varimesh
