// The orientation of a mesh is that of most of its straight-sided cells.
#include "core/validity/orientation.h"

#include <gtest/gtest.h>

#include "tests/core/support/made_cells.h"

namespace varimesh::detail {
namespace {

using testing::Place;

/// Reference cells, the first `mirrored` of them turned over.
HighOrderMesh cells(Shape shape, int count, int mirrored) {
  HighOrderMesh mesh = testing::empty_mesh(shape, 2);
  for (int i = 0; i < count; ++i)
    testing::add_cell(mesh, shape, [&](Place p) { return Place{i < mirrored ? -p[0] : p[0], p[1], p[2]}; });
  return mesh;
}

TEST(Orientation, IsThatOfMostCells) {
  for (const Shape shape : testing::kCellShapes) {
    EXPECT_EQ(orientation(cells(shape, 5, 0)), 1);
    EXPECT_EQ(orientation(cells(shape, 5, 2)), 1);
    EXPECT_EQ(orientation(cells(shape, 4, 2)), 1) << "half and half";
    EXPECT_EQ(orientation(cells(shape, 5, 3)), -1);
    EXPECT_EQ(orientation(cells(shape, 5, 5)), -1);
  }
}

TEST(Orientation, GoesByTheVerticesAndNotByTheCurvedSides) {
  for (const Shape shape : testing::kCellShapes) {
    HighOrderMesh mesh = testing::one_cell(shape, 3, [](Place p) { return p; });
    const int vertices = reference::info(shape).vertices;
    // All nodes but the vertices are put far away.
    for (std::size_t i = 3 * static_cast<std::size_t>(vertices); i < mesh.coordinates.size(); i += 3)
      mesh.coordinates[i] *= -100;
    EXPECT_EQ(orientation(mesh), 1);
  }
}

}  // namespace
}  // namespace varimesh::detail
