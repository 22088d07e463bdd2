// What does not hang together in a mesh is said, and coincident nodes can be joined.
#include "core/mesh/loose_parts.h"

#include <gtest/gtest.h>

#include "core/mesh/changes/merge_nodes.h"
#include "core/mesh/check.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

std::vector<std::string> said(const HighOrderMesh& mesh) {
  const auto sound = check_structure(mesh);
  EXPECT_TRUE(sound) << sound.error().sentence;
  return loose_parts(mesh, facets(mesh), Team(1));
}

/// Both meshes in one, with nodes of their own.
HighOrderMesh beside(HighOrderMesh mesh, const HighOrderMesh& other) {
  const auto shift = std::int32_t(mesh.node_count());
  mesh.coordinates.insert(mesh.coordinates.end(), other.coordinates.begin(), other.coordinates.end());
  const std::int64_t last = *std::ranges::max_element(mesh.node_numbers);
  for (std::size_t i = 0; i < other.node_count(); ++i) mesh.node_numbers.push_back(last + 1 + std::int64_t(i));
  for (ElementBlock block : other.blocks) {
    for (std::int32_t& node : block.nodes) node += shift;
    for (std::int64_t& number : block.numbers) number += 10000;
    mesh.blocks.push_back(block);
  }
  mesh.node_blocks = {{-1, 0, 0, std::int32_t(mesh.node_count())}};
  return mesh;
}

HighOrderMesh moved(Filling filling, std::array<int, 3> counts, int order, const std::function<Place(Place)>& map) {
  HighOrderMesh mesh = testing::grid(filling, counts, order);
  testing::move_nodes(mesh, map);
  return mesh;
}

TEST(LooseParts, AreNotFoundInSoundMeshes) {
  for (const Filling filling : testing::kFillings)
    EXPECT_TRUE(said(testing::grid(filling, {3, 2, 2}, 3, testing::bent(testing::is_plane(filling) ? 2 : 3))).empty())
        << testing::name(filling);
}

TEST(LooseParts, CoincidentNodesAreCountedAndJoined) {
  const HighOrderMesh one = testing::grid(Filling::Hexahedra, {1, 1, 1}, 2);
  double width = 0;
  for (std::size_t i = 0; i < one.coordinates.size(); i += 3) width = std::max(width, one.coordinates[i]);
  const auto right = [&](Place at) { return Place{at[0] + width, at[1], at[2]}; };
  HighOrderMesh mesh = beside(one, moved(Filling::Hexahedra, {1, 1, 1}, 2, right));
  const auto sentences = said(mesh);
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_EQ(sentences[0].find("9 nodes of the boundary lie where another node lies"), 0U) << sentences[0];
  EXPECT_EQ(merge_nodes(mesh, 1e-9), 9U);
  EXPECT_EQ(mesh.node_count(), 2 * 27U - 9);
  EXPECT_TRUE(said(mesh).empty());
  EXPECT_EQ(facets(mesh).neighbour.size(), 12U);
  EXPECT_EQ(std::ranges::count_if(facets(mesh).neighbour, [](std::int32_t n) { return n >= 0; }), 2);
}

/// Nodes that are joined by others between them belong to one group, in any order of their numbers.
TEST(LooseParts, ChainsOfCoincidentNodesAreOneGroup) {
  HighOrderMesh mesh;
  mesh.coordinates = {.018, 0, 0, 0, 0, 0, .009, 0, 0, 1, 0, 0};
  const auto pairs = coincident_nodes(mesh, {0, 1, 2, 3}, .01);
  EXPECT_EQ(pairs, (std::vector<std::pair<std::int32_t, std::int32_t>>{{1, 0}, {2, 0}}));
}

TEST(LooseParts, HangingNodesAreCounted) {
  for (const int order : {1, 3}) {
    // One square beside two of half its height.
    const HighOrderMesh one = testing::grid(Filling::Quadrilaterals, {1, 1, 0}, order);
    double width = 0, height = 0;
    for (std::size_t i = 0; i < one.coordinates.size(); i += 3) {
      width = std::max(width, one.coordinates[i]);
      height = std::max(height, one.coordinates[i + 1]);
    }
    HighOrderMesh two = testing::grid(Filling::Quadrilaterals, {1, 2, 0}, order);
    double tall = 0;
    for (std::size_t i = 0; i < two.coordinates.size(); i += 3) tall = std::max(tall, two.coordinates[i + 1]);
    testing::move_nodes(two, [&](Place at) { return Place{at[0] + width, at[1] * height / tall, 0}; });
    HighOrderMesh mesh = beside(one, two);
    merge_nodes(mesh, 1e-9);
    const auto sentences = said(mesh);
    ASSERT_EQ(sentences.size(), 1U) << sentences[0];
    EXPECT_EQ(sentences[0].find("1 vertex of the boundary lies on a side of a cell"), 0U) << sentences[0];
  }
}

TEST(LooseParts, FacetsAndNodesInNoCellAreCounted) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {1, 1, 1}, 1);
  mesh.coordinates.insert(mesh.coordinates.end(), {9, 0, 0, 9, 1, 0, 9, 0, 1, 8, 8, 8});
  for (const std::int64_t number : {901, 902, 903, 904}) mesh.node_numbers.push_back(number);
  mesh.node_blocks.back().count += 4;
  const auto first = std::int32_t(mesh.node_count()) - 4;
  mesh.blocks.push_back({Shape::Triangle, 1, 77, {}, {777}, {first, first + 1, first + 2}, {}, {}});
  const auto sentences = said(mesh);
  ASSERT_EQ(sentences.size(), 2U);
  EXPECT_EQ(sentences[0].find("1 boundary element lies on no cell, for example element 777"), 0U) << sentences[0];
  EXPECT_EQ(sentences[1], "4 nodes belong to no cell, for example node 901.");
}

}  // namespace
}  // namespace varimesh
