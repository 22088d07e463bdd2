// A boundary that is given apart from the mesh: as a list of displacements, or as a mesh of the boundary only.
#include "core/mesh/changes/displacements.h"

#include <gtest/gtest.h>

#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

std::int32_t inner_node(const HighOrderMesh& mesh) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t n = 0; n < fixed.size(); ++n)
    if (!fixed[n]) return std::int32_t(n);
  return -1;
}

TEST(Displacements, ReadsNumbersBlanksAndComments) {
  const auto read = read_displacements("# bump\n\n  3 0.5 -1e-3 +2\n17\t1 2  # two only\r\n", 2);
  ASSERT_TRUE(read) << read.error().sentence;
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[0].number, 3);
  EXPECT_EQ((*read)[0].by, (std::array{0.5, -1e-3, 2.0}));
  EXPECT_EQ((*read)[1].by, (std::array{1.0, 2.0, 0.0}));
}

TEST(Displacements, NamesTheLineThatIsWrong) {
  for (const char* line : {"5", "5 1", "5 1 2 3 4", "x 1 2 3", "5 1 2 z", "5 1 nope 3"}) {
    const auto read = read_displacements(std::string("1 0 0 0\n") + line, 2);
    ASSERT_FALSE(read) << line;
    EXPECT_NE(read.error().sentence.find("Line 2"), std::string::npos) << read.error().sentence;
  }
}

TEST(Displacements, NeedThreeNumbersIn3D) {
  EXPECT_TRUE(read_displacements("1 0 0 0\n5 1 2\n", 2));
  const auto read = read_displacements("1 0 0 0\n5 1 2\n", 3);
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().sentence.find("Line 2"), std::string::npos) << read.error().sentence;
  EXPECT_NE(read.error().sentence.find("dz"), std::string::npos) << read.error().sentence;
}

TEST(Displacements, MustNotBeEmpty) {
  for (const char* text : {"", "\n\n", "# nothing\n"}) {
    const auto read = read_displacements(text, 3);
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().sentence.find("empty"), std::string::npos) << read.error().sentence;
  }
}

TEST(Displacements, MoveTheirNodesAndNoOthers) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 3);
  const HighOrderMesh before = mesh;
  const std::int32_t node = testing::side_nodes(mesh, 1).front();
  const NodeDisplacement displacement{mesh.node_numbers[std::size_t(node)], {0.1, 0.2, 0}};
  ASSERT_TRUE(displace_boundary(mesh, std::span(&displacement, 1)));
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) {
    const double by = i / 3 == std::size_t(node) ? displacement.by[i % 3] : 0.0;
    EXPECT_EQ(mesh.coordinates[i], before.coordinates[i] + by);
  }
}

TEST(Displacements, RefuseNodesThatAreNotOnTheBoundary) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 3);
  const HighOrderMesh before = mesh;
  const std::int64_t inside = mesh.node_numbers[std::size_t(inner_node(mesh))];
  const std::int64_t edge = mesh.node_numbers[std::size_t(testing::side_nodes(mesh, 1).front())];
  const double infinite = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<std::vector<NodeDisplacement>, std::string>> cases{
      {{{999999, {1, 0, 0}}}, "does not have"},
      {{{edge, {0.1, 0, 0}}, {inside, {1, 0, 0}}}, "inside"},
      {{{edge, {0.1, 0, 0}}, {edge, {0.1, 0, 0}}}, "twice"},
      {{{edge, {0, 0, 1}}}, "plane"},
      {{{edge, {infinite, 0, 0}}}, "finite"},
  };
  for (const auto& [list, word] : cases) {
    const auto refused = displace_boundary(mesh, list);
    ASSERT_FALSE(refused) << word;
    EXPECT_NE(refused.error().sentence.find(word), std::string::npos) << refused.error().sentence;
    EXPECT_EQ(mesh.coordinates, before.coordinates) << "a refused list must change nothing";
  }
}

// The boundary elements of a mesh, as a mesh of their own.
HighOrderMesh boundary_of(const HighOrderMesh& mesh) {
  HighOrderMesh boundary = mesh;
  std::erase_if(boundary.blocks,
                [&](const ElementBlock& b) { return reference::info(b.shape).dimension == mesh.dimension; });
  boundary.dimension = mesh.dimension - 1;
  return boundary;
}

TEST(Displacements, ACurvedBoundaryReplacesAStraightOne) {
  const HighOrderMesh straight = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2);
  HighOrderMesh curved = straight;
  const std::vector<bool> fixed = fixed_nodes(straight);
  for (std::size_t n = 0; n < curved.node_count(); ++n)
    if (fixed[n]) curved.coordinates[3 * n] += 0.05 * std::sin(curved.coordinates[3 * n + 1]);
  HighOrderMesh mesh = straight;
  ASSERT_TRUE(replace_boundary(mesh, boundary_of(curved)));
  EXPECT_EQ(mesh.coordinates, curved.coordinates);
}

TEST(Displacements, RefuseTheBoundaryOfAnotherMesh) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {1, 1, 1}, 2);
  const auto whole = replace_boundary(mesh, mesh);
  ASSERT_FALSE(whole);
  EXPECT_NE(whole.error().sentence.find("inside"), std::string::npos);
  HighOrderMesh other = boundary_of(mesh);
  for (std::int64_t& number : other.node_numbers) number += 100000;
  const auto strange = replace_boundary(mesh, other);
  ASSERT_FALSE(strange);
  EXPECT_NE(strange.error().sentence.find("does not have"), std::string::npos);
  other.blocks.clear();
  EXPECT_FALSE(replace_boundary(mesh, other));
}

}  // namespace
}  // namespace varimesh
