// Which cells of whole meshes are called unrepairable, and which must not be.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/diagnosis/diagnose.h"
#include "core/mesh/connectivity.h"
#include "core/validity/certificate.h"
#include "tests/core/support/made_cells.h"

namespace varimesh {
namespace {

using testing::Place;
using Kind = UnrepairableGroup::Kind;

/// Merges nodes at the same place.
void merge_nodes(HighOrderMesh& mesh) {
  std::map<std::array<long, 3>, std::int32_t> number;
  std::vector<double> coordinates;
  for (ElementBlock& block : mesh.blocks)
    for (std::int32_t& node : block.nodes) {
      const double* x = mesh.coordinates.data() + 3 * static_cast<std::size_t>(node);
      const std::array<long, 3> key{std::lround(x[0] * 1e6), std::lround(x[1] * 1e6), std::lround(x[2] * 1e6)};
      const auto [entry, added] = number.emplace(key, static_cast<std::int32_t>(number.size()));
      if (added) coordinates.insert(coordinates.end(), x, x + 3);
      node = entry->second;
    }
  mesh.coordinates = coordinates;
  mesh.node_numbers.resize(mesh.node_count());
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.node_numbers[n] = static_cast<std::int64_t>(n) + 1;
}

/// n³ unit cubes, without the inner ones if `hollow`, as hexahedra or as six tetrahedra each.
HighOrderMesh cubes(int n, int order, bool hollow, bool tetrahedra) {
  HighOrderMesh mesh = testing::empty_mesh(tetrahedra ? Shape::Tetrahedron : Shape::Hexahedron, order);
  // Kuhn's six tetrahedra along the main diagonal, one for each permutation of the axes.
  const int permutations[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
  for (int i = 0; i < n * n * n; ++i) {
    const int corner[3] = {i % n, i / n % n, i / n / n};
    const bool middle = std::ranges::all_of(corner, [n](int c) { return c > 0 && c + 1 < n; });
    if (hollow && middle) continue;
    if (!tetrahedra) {
      testing::add_cell(mesh, Shape::Hexahedron, [&](Place p) {
        for (std::size_t c = 0; c < 3; ++c) p[c] = corner[c] + (p[c] + 1) / 2;
        return p;
      });
      continue;
    }
    for (int k = 0; k < 6; ++k)
      testing::add_cell(mesh, Shape::Tetrahedron, [&](Place p) {
        const double a = (p[0] + 1) / 2, b = (p[1] + 1) / 2, c = (p[2] + 1) / 2;
        // Vertices 0, e_i, e_i + e_j, 1. An odd permutation swaps the middle two.
        const double first = a + b + c, second = k < 3 ? b + c : a + c, third = c;
        Place at{};
        at[static_cast<std::size_t>(permutations[k][0])] = first;
        at[static_cast<std::size_t>(permutations[k][1])] = second;
        at[static_cast<std::size_t>(permutations[k][2])] = third;
        for (std::size_t d = 0; d < 3; ++d) at[d] += corner[d];
        return at;
      });
  }
  merge_nodes(mesh);
  return mesh;
}

int count(const std::vector<UnrepairableGroup>& groups, Kind kind) {
  return static_cast<int>(std::ranges::count(groups, kind, &UnrepairableGroup::kind));
}

UnrepairableGroup group_of(std::vector<std::int32_t> cells) {
  UnrepairableGroup group;
  group.cells = std::move(cells);
  return group;
}

TEST(LeastInvalid, CountsGroupsWithoutACommonElement) {
  EXPECT_EQ(least_invalid({}), 0U);
  EXPECT_EQ(least_invalid({group_of({3}), group_of({3}), group_of({5})}), 2U);
  EXPECT_EQ(least_invalid({group_of({1, 2, 3}), group_of({3}), group_of({4, 5}), group_of({5})}), 2U);
  EXPECT_EQ(least_invalid({group_of({1, 2}), group_of({3, 4}), group_of({2, 3})}), 2U);
  // It is a bound: two have to stay here, and a better choice of groups would show it in the second case.
  EXPECT_EQ(least_invalid({group_of({1, 2}), group_of({2, 3}), group_of({1, 3})}), 1U);
  EXPECT_EQ(least_invalid({group_of({2, 3}), group_of({1, 2}), group_of({3, 4})}), 1U);
}

TEST(Diagnosis, ABoxIsFine) {
  for (const bool tetrahedra : {false, true}) {
    const HighOrderMesh mesh = cubes(3, 2, false, tetrahedra);
    for (const Certificate& c : certify(mesh)) ASSERT_EQ(c.answer, Certificate::Answer::Valid);
    EXPECT_TRUE(diagnose(mesh).empty());
  }
}

TEST(Diagnosis, ABoxInABoxIsFine) {
  for (const bool tetrahedra : {false, true})
    for (const int order : {1, 2, 3}) EXPECT_TRUE(diagnose(cubes(3, order, true, tetrahedra)).empty()) << order;
}

TEST(Diagnosis, AMirroredBoxInABoxIsFine) {
  HighOrderMesh mesh = cubes(3, 2, true, true);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.coordinates[3 * n] *= -1;
  EXPECT_TRUE(diagnose(mesh).empty());
}

TEST(Diagnosis, TangledFreeNodesAreNotNamed) {
  HighOrderMesh mesh = cubes(3, 2, false, true);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> shake(-0.7, 0.7);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t c = 0; c < 3; ++c)
      if (!fixed[n]) mesh.coordinates[3 * n + c] += shake(random);
  EXPECT_GT(summarise(certify(mesh)).invalid, 20);
  EXPECT_TRUE(diagnose(mesh).empty());
}

/// A single quadratic tetrahedron with one node moved. All its nodes are fixed.
HighOrderMesh lone_tetrahedron(std::size_t node, Place by) {
  HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](Place p) { return p; });
  mesh.blocks[0].numbers = {4711};
  for (std::size_t c = 0; c < 3; ++c) mesh.coordinates[3 * node + c] += by[c];
  return mesh;
}

TEST(Diagnosis, ACellWithFixedEdgesInOnePlaneIsNamedAtItsVertex) {
  // Node 4 is the middle of the edge from vertex 0 to vertex 1. The edge's tangent at vertex 0 now points away from the
  // cell.
  const HighOrderMesh mesh = lone_tetrahedron(4, {-0.6, 0.2, 0.2});
  const auto groups = diagnose(mesh);
  ASSERT_GE(count(groups, Kind::Vertex), 1);
  const UnrepairableGroup& group = groups.front();
  EXPECT_EQ(group.kind, Kind::Vertex);
  EXPECT_EQ(group.elements, std::vector<std::int64_t>{4711});
  EXPECT_EQ(group.vertex, 1);
  EXPECT_LE(group.determinant, 0);
  EXPECT_NE(group.sentence.find("tetrahedron 4711"), std::string::npos);
  EXPECT_NE(group.sentence.find("node 1 "), std::string::npos);
  EXPECT_NE(certify(mesh)[0].answer, Certificate::Answer::Valid);
}

TEST(Diagnosis, ACellBetweenTwoFixedFacesIsNamedAlongTheirEdge) {
  // J is negative along the first edge, between its ends, and positive at them.
  HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 4, [](Place p) {
    const double t = p[0] + 1;  // from 0 at vertex 0 to 2 at vertex 1
    return Place{p[0], (p[1] + 1) * (1 - 1.2 * t * (2 - t)), p[2] + 1};
  });
  const auto groups = diagnose(mesh);
  EXPECT_EQ(count(groups, Kind::Vertex), 0);
  EXPECT_GE(count(groups, Kind::Edge), 1);
  EXPECT_LT(std::ranges::find(groups, Kind::Edge, &UnrepairableGroup::kind)->determinant, 0);
}

TEST(Diagnosis, AFlatFaceThatFoldsIsNamed) {
  // Node 4 moves within the plane of the face (0, 1, 2), past its middle.
  const HighOrderMesh mesh = lone_tetrahedron(4, {0, 1.2, 0});
  const auto groups = diagnose(mesh);
  EXPECT_EQ(count(groups, Kind::FoldedFace), 1);
}

TEST(Diagnosis, AFaceThatBulgesIsNotNamed) {
  for (const double height : {-0.4, -2.0})
    EXPECT_EQ(count(diagnose(lone_tetrahedron(4, {0, 0, height})), Kind::FoldedFace), 0);
}

TEST(Diagnosis, ATriangleWithFoldedEdgesIsNamedAtTheVertex) {
  HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](Place p) { return p; });
  mesh.coordinates[3 * 3] = -1.2;     // the middle of the first edge, which now leaves vertex 0
  mesh.coordinates[3 * 3 + 1] = 0.4;  // on the wrong side of the third edge
  const auto groups = diagnose(mesh);
  ASSERT_GE(count(groups, Kind::Vertex), 1);
  EXPECT_EQ(groups.front().vertex, 1);
}

TEST(Diagnosis, AStraightEdgeThatFoldsIsNamed) {
  HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](Place p) { return p; });
  mesh.coordinates[3 * 3] = 0.8;
  const auto groups = diagnose(mesh);
  EXPECT_EQ(count(groups, Kind::FoldedFace), 1);
  EXPECT_NE(groups.back().sentence.find("straight edge"), std::string::npos);
}

TEST(Diagnosis, FreedNodesAreNotHeldAgainstACell) {
  const HighOrderMesh mesh = lone_tetrahedron(4, {-0.6, 0.2, 0.2});
  std::vector<bool> fixed(mesh.node_count(), true);
  fixed[4] = false;
  EXPECT_TRUE(diagnose(mesh, fixed, Team(1)).empty());
}

TEST(Diagnosis, TheNumberOfThreadsDoesNotMatter) {
  HighOrderMesh mesh = cubes(5, 1, true, true);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> shake(-0.5, 0.5);
  for (double& x : mesh.coordinates) x += shake(random);
  const auto one = diagnose(mesh, 1), two = diagnose(mesh, 2);
  ASSERT_GT(one.size(), 10U);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].sentence, two[i].sentence);
}

}  // namespace
}  // namespace varimesh
