// Counts of places and neighbours against plain ones, and sizes of meshes that are too large to make.
#include "core/mesh/mesh_counts.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

class CountsOf : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, CountsOf, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

std::int64_t free_count(const HighOrderMesh& mesh) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  return std::count(fixed.begin(), fixed.end(), false);
}

/// Ordered pairs of different free nodes that share a cell.
std::int64_t plain_neighbours(const HighOrderMesh& mesh) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const Cells cells(mesh, mesh.dimension);
  std::set<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (const std::int32_t a : cells.nodes(cell))
      for (const std::int32_t b : cells.nodes(cell))
        if (a != b && !fixed[std::size_t(a)] && !fixed[std::size_t(b)]) pairs.emplace(a, b);
  return std::int64_t(pairs.size());
}

TEST_P(CountsOf, NodesOfAnyOrderFollowFromAMeshOfOrder3) {
  const HighOrderMesh mesh = testing::grid(GetParam(), {4, 3, 3}, 3);
  const MeshCounts counts = count(mesh, 3);
  EXPECT_EQ(counts.unused, 0);
  for (int order = 1; order <= 6; ++order) {
    const HighOrderMesh other = testing::grid(GetParam(), {4, 3, 3}, order);
    EXPECT_EQ(counts.all.nodes(order), std::int64_t(other.node_count())) << "order " << order;
    EXPECT_EQ(counts.free.nodes(order), free_count(other)) << "order " << order;
  }
}

TEST_P(CountsOf, NodesOfHigherOrdersFollowFromALinearMesh) {
  const HighOrderMesh mesh = testing::grid(GetParam(), {4, 3, 3}, 1);
  for (int order = 1; order <= 6; ++order) {
    const HighOrderMesh other = testing::grid(GetParam(), {4, 3, 3}, order);
    EXPECT_EQ(count(mesh, order).all.nodes(order), std::int64_t(other.node_count())) << "order " << order;
    EXPECT_EQ(count(mesh, order).free.nodes(order), free_count(other)) << "order " << order;
  }
}

TEST_P(CountsOf, NeighboursAreThoseOfAPlainCount) {
  for (const int low_order : {1, 2}) {
    const std::int64_t plain = plain_neighbours(testing::grid(GetParam(), {4, 3, 3}, low_order));
    const std::int64_t counted = count(testing::grid(GetParam(), {4, 3, 3}, 4), 4).neighbours[std::size_t(low_order)];
    EXPECT_NEAR(double(counted), double(plain), 0.1 * double(plain)) << "order " << low_order;
  }
}

TEST(Counts, AFileWithoutBoundaryElementsHasTheSameFreeNodes) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 3, 3}, 2);
  const MeshCounts with = count(mesh, 2);
  std::erase_if(mesh.blocks, [](const ElementBlock& block) { return block.shape == Shape::Triangle; });
  const MeshCounts without = count(mesh, 2);
  EXPECT_EQ(without.free_nodes(), with.free_nodes());
  EXPECT_EQ(without.free.triangles, with.free.triangles);
}

TEST(Counts, OfAMeshThatIsTooLargeToMakeDoNotOverflow) {
  // 300 million tetrahedra of order 4: 3.2e9 nodes, more than 2³¹, and 1.05e10 nodes of cells.
  MeshCounts counts;
  counts.dimension = 3;
  counts.order = 4;
  counts.cells[std::size_t(Shape::Tetrahedron)] = 300'000'000;
  counts.all = {50'000'000, 350'000'000, 600'000'000, 0, counts.cells};
  counts.free = counts.free_in_cells = counts.all;
  const std::int64_t nodes = 50'000'000 + 3 * std::int64_t{350'000'000} + 3 * std::int64_t{600'000'000} + 300'000'000;
  EXPECT_EQ(counts.nodes(), nodes);
  EXPECT_GT(nodes, std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(bytes_of_mesh(counts), nodes * 32 + std::int64_t{300'000'000} * (8 + 4 * 35));
  EXPECT_GT(bytes_of_check(counts), std::int64_t{300'000'000} * 32);
}

}  // namespace
}  // namespace varimesh
