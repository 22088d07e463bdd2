// Clusters share out all cells, have the size asked for, and hold cells that are near each other.
#include "core/problem/clusters/clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

class ClusterCells : public ::testing::TestWithParam<Filling> {
 protected:
  HighOrderMesh mesh() const { return testing::grid(GetParam(), {5, 4, 3}, 2); }
};

INSTANTIATE_TEST_SUITE_P(Fillings, ClusterCells, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(ClusterCells, PutsEveryCellIntoOneCluster) {
  const HighOrderMesh mesh = this->mesh();
  for (const std::int32_t size : {1, 3, 10, 100000}) {
    Clusters clusters = cluster_cells(mesh, size);
    ASSERT_EQ(clusters.begin.front(), 0);
    ASSERT_EQ(clusters.begin.back(), static_cast<std::int32_t>(clusters.cells.size()));
    std::vector<std::int32_t> every(mesh.element_count(mesh.dimension));
    std::iota(every.begin(), every.end(), 0);
    std::ranges::sort(clusters.cells);
    EXPECT_EQ(clusters.cells, every) << size;
  }
}

TEST_P(ClusterCells, FillsEveryClusterButTheLast) {
  for (const std::int32_t size : {1, 3, 10, 100000}) {
    const Clusters clusters = cluster_cells(mesh(), size);
    for (std::size_t c = 0; c + 2 < clusters.begin.size(); ++c)
      EXPECT_EQ(clusters.begin[c + 1] - clusters.begin[c], size);
    const std::int32_t last = clusters.begin.back() - clusters.begin[clusters.begin.size() - 2];
    EXPECT_GT(last, 0);
    EXPECT_LE(last, size);
  }
}

TEST_P(ClusterCells, TakesCellsThatTouchWhatIsTakenAlready) {
  const HighOrderMesh mesh = this->mesh();
  const Clusters clusters = cluster_cells(mesh, 7);
  const Cells cells(mesh, mesh.dimension);
  std::vector<bool> touched(mesh.node_count(), false);
  for (std::size_t i = 0; i < clusters.cells.size(); ++i) {
    const auto cell = static_cast<std::size_t>(clusters.cells[i]);
    const auto vertices =
        cells.nodes(cell).first(static_cast<std::size_t>(reference::info(cells.shape(cell)).vertices));
    const bool touches =
        std::ranges::any_of(vertices, [&](std::int32_t v) { return touched[static_cast<std::size_t>(v)]; });
    EXPECT_TRUE(i == 0 || touches) << "cell " << cell;
    for (const std::int32_t v : vertices) touched[static_cast<std::size_t>(v)] = true;
  }
}

TEST_P(ClusterCells, DoesNotDependOnCoordinates) {
  const HighOrderMesh mesh = this->mesh();
  HighOrderMesh moved = mesh;
  testing::move_nodes(moved, testing::bent(mesh.dimension, 0.3));
  const Clusters before = cluster_cells(mesh, 5), after = cluster_cells(moved, 5);
  EXPECT_EQ(before.cells, after.cells);
  EXPECT_EQ(before.begin, after.begin);
}

TEST(ClustersOfARow, FollowTheRow) {
  const Clusters clusters = cluster_cells(testing::grid(Filling::Quadrilaterals, {8, 1, 0}, 1), 3);
  EXPECT_EQ(clusters.cells, (std::vector<std::int32_t>{0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(clusters.begin, (std::vector<std::int32_t>{0, 3, 6, 8}));
}

TEST(ClustersOfSeparateCells, TakeThemInTheirOrder) {
  HighOrderMesh mesh = testing::empty_mesh(Shape::Triangle, 2);
  for (int i = 0; i < 5; ++i) testing::add_cell(mesh, Shape::Triangle, [](testing::Place p) { return p; });
  const Clusters clusters = cluster_cells(mesh, 2);
  EXPECT_EQ(clusters.cells, (std::vector<std::int32_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(clusters.begin, (std::vector<std::int32_t>{0, 2, 4, 5}));
}

}  // namespace
}  // namespace varimesh
