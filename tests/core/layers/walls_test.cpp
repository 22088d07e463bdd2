// Which walls have layers, and how high these go.
#include <gtest/gtest.h>

#include "core/base/index.h"
#include "tests/core/layers/layer_meshes.h"

namespace varimesh {
namespace {

/// The end of a flat plate is a straight line, whatever the spacing of its nodes. The last layer is higher than wide,
/// so its cell is thin over the end.
TEST(Walls, AreNotCurvedByNodesThatAreUnevenlySpaced) {
  HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 6, 1e-2, 3, Inside::Parallel, false});
  const double before = static_cast<double>(start(mesh).cells);
  std::size_t moved = 0;
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    if (mesh.coordinates[3 * node] == 0 && mesh.coordinates[3 * node + 1] > 1.3 &&
        mesh.coordinates[3 * node + 1] < 3.6) {
      mesh.coordinates[3 * node + 1] += 0.05;
      ++moved;
    }
  ASSERT_GT(moved, 0U);
  EXPECT_EQ(before, 0);
  EXPECT_EQ(start(mesh).cells, 0);
}

/// The vertices of a quadrilateral on a sphere are not in one plane. They are farther from it here than the first layer
/// is high.
TEST(Walls, OfWarpedQuadrilateralsHaveLayersOfAnyThickness) {
  for (const double first : {1e-2, 1e-4, 1e-7}) {
    HighOrderMesh mesh = make({Shape::Hexahedron, 2, 6, first, std::pow(0.4 / first, 0.2), Inside::Parallel, false});
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      double* x = &mesh.coordinates[3 * node];
      const double a = std::tan(0.5 * (x[0] - 0.8)), b = std::tan(1.5 * (x[2] - 0.3));
      const double scale = (1 + x[1]) / std::hypot(a, b, 1.0);
      x[0] = a * scale;
      x[1] = scale;
      x[2] = b * scale;
    }
    const LayerStart started = start(mesh);
    EXPECT_EQ(static_cast<std::size_t>(started.cells), mesh.element_count(3)) << first;
    EXPECT_EQ(std::ranges::count(started.held, 1), static_cast<std::ptrdiff_t>(mesh.node_count())) << first;
  }
}

/// Cells round a body become wider outwards. All of these are less high than one and a half times their width, but the
/// last ones are twice as high as the edges of the wall are long.
TEST(Walls, HaveLayersAsFarAsCellsAreLowerThanWide) {
  const Layers layers{Shape::Quadrilateral, 3, 8, 0.01, 1.85, Inside::StraightSided};
  const HighOrderMesh mesh = make(layers);
  ASSERT_GT(uncertified(mesh, mesh.coordinates), 0);
  ASSERT_GT(layers.height(8) - layers.height(7), 0.7);
  const LayerStart started = start(mesh);
  EXPECT_EQ(static_cast<std::size_t>(started.placed), mesh.element_count(2));
}

/// The cells at the far boundary are thin too, because they become wider outwards. They are layers of the inner wall.
TEST(Walls, DoNotBeginAtAFarBoundary) {
  const Layers layers{Shape::Quadrilateral, 3, 8, 0.02, 1.4, Inside::Parallel};
  const HighOrderMesh mesh = make(layers);
  ASSERT_LT(layers.height(8) - layers.height(7), 0.5 * 0.3 * (1 + layers.height(8)));
  const LayerStart started = start(mesh);
  EXPECT_EQ(static_cast<std::size_t>(started.cells), mesh.element_count(2));
  EXPECT_EQ(std::ranges::count(started.held, 1), static_cast<std::ptrdiff_t>(mesh.node_count()));
}

}  // namespace
}  // namespace varimesh
