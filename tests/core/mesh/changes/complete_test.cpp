// Serendipity elements and elements of lower order become complete elements of one order, and their geometry stays.
#include "core/mesh/changes/completion/complete.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/mesh/changes/change_order.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/check.h"
#include "core/reference/serendipity.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr std::int64_t kMuch = std::int64_t{1} << 30;

Completion completed(HighOrderMesh& mesh, std::int64_t memory = kMuch) {
  Allowance allowance(memory);
  auto done = complete_elements(mesh, allowance);
  EXPECT_TRUE(done) << (done ? "" : done.error().sentence);
  return done ? *done : Completion();
}

/// The shapes of the mesh that can be serendipity elements, but for triangles, whose functions depend on the order of
/// the vertices.
std::vector<Shape> shapes_of(const HighOrderMesh& mesh) {
  std::vector<Shape> shapes;
  for (const ElementBlock& block : mesh.blocks)
    if (block.shape != Shape::Triangle && reference::serendipity_node_count(block.shape, block.order) > 0 &&
        std::ranges::find(shapes, block.shape) == shapes.end())
      shapes.push_back(block.shape);
  std::ranges::sort(shapes);
  return shapes;
}

/// Whether the elements have their nodes at the same places.
void expect_same_places(const HighOrderMesh& a, const HighOrderMesh& b, double tolerance) {
  ASSERT_EQ(a.blocks.size(), b.blocks.size());
  for (std::size_t i = 0; i < a.blocks.size(); ++i) {
    ASSERT_EQ(a.blocks[i].nodes.size(), b.blocks[i].nodes.size());
    for (std::size_t n = 0; n < a.blocks[i].nodes.size(); ++n)
      for (std::size_t k = 0; k < 3; ++k)
        ASSERT_NEAR(a.coordinates[3 * std::size_t(a.blocks[i].nodes[n]) + k],
                    b.coordinates[3 * std::size_t(b.blocks[i].nodes[n]) + k], tolerance);
  }
}

class Complete : public ::testing::TestWithParam<Filling> {};
INSTANTIATE_TEST_SUITE_P(EveryFilling, Complete, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& p) { return testing::name(p.param); });

// The map of curved_grid() is in the spaces of the serendipity cells.
TEST_P(Complete, SerendipityElementsComeBack) {
  for (const int order : {2, 3}) {
    const HighOrderMesh mesh = testing::curved_grid(GetParam(), order);
    const std::vector<Shape> shapes = shapes_of(mesh);
    const bool plane = testing::is_plane(GetParam());
    if (shapes.empty() || (order > 2 && !plane && GetParam() != Filling::Hexahedra)) continue;
    const auto some = as_serendipity(mesh, shapes);
    ASSERT_TRUE(some);
    EXPECT_LT(some->node_count(), mesh.node_count());
    HighOrderMesh back = *some;
    const Completion done = completed(back);
    EXPECT_EQ(done.serendipity, shapes);
    ASSERT_EQ(done.sentences.size(), 1U);
    EXPECT_NE(done.sentences[0].find("became complete elements of order " + std::to_string(order)), std::string::npos);
    EXPECT_EQ(back.node_count(), mesh.node_count());
    expect_same_places(mesh, back, 1e-13);
    const auto sound = check_structure(back);
    EXPECT_TRUE(sound) << sound.error().sentence;
    for (std::size_t node = 0; node < some->node_count(); ++node)
      EXPECT_EQ(back.node_numbers[node], some->node_numbers[node]);
    for (std::size_t x = 0; x < some->coordinates.size(); ++x) EXPECT_EQ(back.coordinates[x], some->coordinates[x]);
    EXPECT_EQ(*std::ranges::max_element(back.node_numbers), back.node_numbers.back());
    // And once more, bit for bit.
    const auto again = as_serendipity(back, shapes);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->coordinates, some->coordinates);
    EXPECT_EQ(again->blocks.back().nodes, some->blocks.back().nodes);
  }
}

/// A mesh of order `high` in which the second half of the cells has order `low`, and all sides beside them.
HighOrderMesh of_two_orders(const HighOrderMesh& mesh, int low) {
  HighOrderMesh mixed = mesh;
  const auto lowered = change_order(mesh, low);
  EXPECT_TRUE(lowered);
  const auto shift = std::int32_t(mesh.node_count());
  const std::int64_t last = *std::ranges::max_element(mesh.node_numbers);
  mixed.coordinates.insert(mixed.coordinates.end(), lowered->coordinates.begin(), lowered->coordinates.end());
  for (std::size_t i = 0; i < lowered->node_count(); ++i) mixed.node_numbers.push_back(last + 1 + std::int64_t(i));
  mixed.node_blocks = {{-1, 0, 0, std::int32_t(mixed.node_count())}};
  // Vertices are the same nodes.
  std::vector<std::int32_t> place(lowered->node_count());
  for (std::size_t i = 0; i < place.size(); ++i) place[i] = shift + std::int32_t(i);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    for (std::size_t e = 0; e < mesh.blocks[b].size(); ++e)
      for (int v = 0; v < reference::info(mesh.blocks[b].shape).vertices; ++v)
        place[std::size_t(lowered->blocks[b].nodes[e * nodes_per_element(lowered->blocks[b]) + std::size_t(v)])] =
            mesh.blocks[b].nodes[e * nodes_per_element(mesh.blocks[b]) + std::size_t(v)];
  bool second = false;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    if (reference::info(mesh.blocks[b].shape).dimension < mesh.dimension) continue;
    if (std::exchange(second, true)) {
      mixed.blocks[b] = lowered->blocks[b];
      for (std::int32_t& node : mixed.blocks[b].nodes) node = place[std::size_t(node)];
    }
  }
  std::vector<bool> keep(mixed.node_count(), false);
  for (const ElementBlock& block : mixed.blocks)
    for (const std::int32_t node : block.nodes) keep[std::size_t(node)] = true;
  remove_nodes(mixed, keep);
  return mixed;
}

TEST(CompleteOrders, LowerElementsAreRaisedExactly) {
  // Elements of orders 2 and 4 have different nodes in the middle of the edges that they share.
  for (const auto& [low, high] : {std::pair(1, 2), {1, 3}, {1, 4}, {2, 4}}) {
    SCOPED_TRACE(std::to_string(low) + " to " + std::to_string(high));
    // The elements of both orders share straight sides.
    HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {3, 2, 1}, high);
    const HighOrderMesh mixed = of_two_orders(mesh, low);
    HighOrderMesh back = mixed;
    const Completion done = completed(back);
    EXPECT_TRUE(done.serendipity.empty());
    ASSERT_EQ(done.sentences.size(), 1U);
    EXPECT_NE(done.sentences[0].find("became elements of order " + std::to_string(high)), std::string::npos);
    EXPECT_EQ(back.order, high);
    EXPECT_EQ(back.node_count(), mesh.node_count());
    expect_same_places(mesh, back, 1e-13);
    const auto sound = check_structure(back);
    EXPECT_TRUE(sound) << sound.error().sentence;
  }
}

TEST(CompleteOrders, NodesStayIfTheRaisedElementsHaveThem) {
  const HighOrderMesh low = testing::curved_grid(Filling::Hexahedra, 2);
  for (const int order : {3, 4}) {
    HighOrderMesh mesh = low;
    // An element of higher order elsewhere.
    const HighOrderMesh other = testing::grid(Filling::Hexahedra, {1, 1, 1}, order);
    const auto shift = std::int32_t(mesh.node_count());
    for (std::size_t i = 0; i < other.node_count(); ++i) {
      mesh.coordinates.insert(mesh.coordinates.end(), {other.coordinates[3 * i] + 50, other.coordinates[3 * i + 1],
                                                       other.coordinates[3 * i + 2]});
      mesh.node_numbers.push_back(5000 + std::int64_t(i));
    }
    mesh.node_blocks = {{-1, 0, 0, std::int32_t(mesh.node_count())}};
    mesh.blocks.push_back(other.blocks.back());
    for (std::int32_t& node : mesh.blocks.back().nodes) node += shift;
    mesh.blocks.back().numbers = {9000};
    completed(mesh);
    const auto expected = change_order(low, order);
    ASSERT_TRUE(expected);
    EXPECT_EQ(mesh.node_count(), expected->node_count() + other.node_count());
    for (std::size_t b = 0; b < low.blocks.size(); ++b)
      for (std::size_t n = 0; n < mesh.blocks[b].nodes.size(); ++n)
        for (std::size_t k = 0; k < 3; ++k)
          ASSERT_NEAR(mesh.coordinates[3 * std::size_t(mesh.blocks[b].nodes[n]) + k],
                      expected->coordinates[3 * std::size_t(expected->blocks[b].nodes[n]) + k], 1e-13);
    const auto kept = std::ranges::count_if(mesh.node_numbers, [](std::int64_t number) { return number < 5000; });
    EXPECT_EQ(kept == std::int64_t(low.node_count()), order == 4) << "every node of order 2 is one of order 4";
    const auto sound = check_structure(mesh);
    EXPECT_TRUE(sound) << sound.error().sentence;
  }
}

TEST(CompleteOrders, SidesFollowACurvedElement) {
  HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {3, 2, 1}, 2);
  testing::shake(mesh, 0.01, 1);
  HighOrderMesh mixed = of_two_orders(mesh, 1);
  const Completion done = completed(mixed);
  ASSERT_EQ(done.sentences.size(), 2U);
  EXPECT_NE(done.sentences[1].find("curved side"), std::string::npos);
  const auto sound = check_structure(mixed);
  EXPECT_TRUE(sound) << sound.error().sentence;
}

TEST(CompleteOrders, ElementsGetTheirOwnOrderAgain) {
  for (const auto& [low, high] : {std::pair(1, 2), {1, 3}, {2, 3}, {2, 4}}) {
    SCOPED_TRACE(std::to_string(low) + " and " + std::to_string(high));
    const HighOrderMesh mixed = of_two_orders(testing::grid(Filling::MixedSolid, {3, 2, 1}, high), low);
    HighOrderMesh back = mixed;
    const Completion done = completed(back);
    ASSERT_FALSE(done.lower.empty());
    const OwnOrders own = at_own_orders(back, done.lower);
    EXPECT_GT(own.lowered, 0);
    EXPECT_EQ(own.raised, 0);
    ASSERT_EQ(own.mesh.blocks.size(), mixed.blocks.size());
    for (std::size_t b = 0; b < mixed.blocks.size(); ++b) EXPECT_EQ(own.mesh.blocks[b].order, mixed.blocks[b].order);
    EXPECT_EQ(own.mesh.node_count() == mixed.node_count(), low != 2 || high != 4) << "orders 2 and 4 share nodes now";
    EXPECT_EQ(own.mesh.node_numbers.size(), own.mesh.node_count());
    expect_same_places(mixed, own.mesh, 1e-13);
    HighOrderMesh again = own.mesh;
    completed(again);
    const auto sound = check_structure(again);
    EXPECT_TRUE(sound) << sound.error().sentence;
  }
}

TEST(CompleteOrders, ElementsStayRaisedIfTheirOwnOrderLosesGeometry) {
  HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {3, 2, 1}, 2);
  testing::shake(mesh, 0.01, 1);
  HighOrderMesh mixed = of_two_orders(mesh, 1);
  const Completion done = completed(mixed);
  const OwnOrders own = at_own_orders(mixed, done.lower);
  EXPECT_GT(own.raised, 0) << "beside the curved ones";
  std::int64_t lower = 0;
  for (const ElementBlock& block : own.mesh.blocks)
    if (block.order == 1 && block.shape != Shape::Point) lower += std::int64_t(block.size());
  EXPECT_EQ(lower, own.lowered);
  HighOrderMesh again = own.mesh;
  completed(again);
  const auto sound = check_structure(again);
  EXPECT_TRUE(sound) << sound.error().sentence;
}

TEST(CompleteOrders, TakeNoMoreMemoryThanIsAllowed) {
  HighOrderMesh mesh = of_two_orders(testing::grid(Filling::MixedSolid, {3, 2, 1}, 4), 1);
  Allowance allowance(1000);
  const auto done = complete_elements(mesh, allowance);
  ASSERT_FALSE(done);
  EXPECT_NE(done.error().sentence.find("takes more than 8 times"), std::string::npos);
}

TEST(CompleteOrders, WholeMeshesStayAsTheyAre) {
  const HighOrderMesh mesh = testing::curved_grid(Filling::MixedSolid, 2);
  HighOrderMesh same = mesh;
  EXPECT_TRUE(completed(same, 0).sentences.empty());
  EXPECT_EQ(same.coordinates, mesh.coordinates);
}

TEST(SerendipityElements, AreNotMadeOfOthers) {
  HighOrderMesh mesh = testing::curved_grid(Filling::Hexahedra, 2);
  mesh.coordinates[3 * std::size_t(mesh.blocks.back().nodes.back())] += 1e-6;
  EXPECT_FALSE(as_serendipity(mesh, {Shape::Hexahedron}));
}

}  // namespace
}  // namespace varimesh
