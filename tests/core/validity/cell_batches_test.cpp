// The cells of a mesh in batches, and one table for each shape.
#include "core/validity/cell_batches.h"

#include <gtest/gtest.h>

#include <string>

#include "core/mesh/connectivity.h"
#include "tests/core/support/meshes.h"

namespace varimesh::detail {
namespace {

TEST(CellRanges, CoverAllCellsInTheMeshsOrder) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::MixedSolid, {5, 2, 2}, 2);
  const Cells cells(mesh, 3);
  for (const std::size_t size : {std::size_t{1}, std::size_t{7}, std::size_t{1000}}) {
    std::size_t next = 0;
    for (const CellBatch& range : cell_batches(mesh, [&](const ElementBlock&) { return size; })) {
      EXPECT_EQ(range.cell, next);
      EXPECT_GT(range.count, 0U);
      EXPECT_LE(range.count, size);
      for (std::size_t i = 0; i < range.count; ++i) {
        EXPECT_EQ(range.block->shape, cells.shape(next + i));
        EXPECT_EQ(range.nodes(i), cells.nodes(next + i).data());
      }
      next += range.count;
    }
    EXPECT_EQ(next, cells.count());
  }
}

TEST(CellRanges, TakeOneCellAtLeast) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::Quadrilaterals, {3, 1, 0}, 1);
  EXPECT_EQ(cell_batches(mesh, [](const ElementBlock&) { return 0; }).size(), 3U);
}

TEST(TablesForCells, HaveOneForEachShape) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::MixedSolid, {5, 2, 2}, 2);
  int made = 0;
  const auto tables = tables_for_cells<std::string>(mesh, [&](Shape shape, int order) {
    ++made;
    return std::string(reference::info(shape).name) + " " + std::to_string(order);
  });
  EXPECT_EQ(made, 4) << "hexahedra, pyramids, tetrahedra and prisms, but no boundary elements";
  EXPECT_EQ(tables.at({Shape::Prism, 2}), "prism 2");
  EXPECT_FALSE(tables.contains({Shape::Triangle, 2}));
}

}  // namespace
}  // namespace varimesh::detail
