// Straight sides are those of the cell on the same vertices, whatever the shape.
#include "core/mesh/changes/straight_sides.h"

#include <gtest/gtest.h>

#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

TEST(StraightSidedMesh, HasNoNodeElsewhere) {
  for (const testing::Filling filling : testing::kFillings)
    for (int order = 1; order <= 4; ++order) {
      // The vertices are bent, and the cells between them straight.
      HighOrderMesh mesh = testing::grid(filling, {4, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
      EXPECT_TRUE(has_straight_sides(mesh)) << testing::name(filling) << " of order " << order;
      if (order == 1) continue;
      mesh.coordinates[3 * (mesh.node_count() - 1)] += 1e-6;
      EXPECT_FALSE(has_straight_sides(mesh)) << testing::name(filling) << " of order " << order;
    }
}

}  // namespace
}  // namespace varimesh
