// How cells are cut, shape by shape: the fast way to place nodes against the plain one.
#include "core/layers/split/cut_pattern.h"

#include <gtest/gtest.h>

#include <set>

#include "core/layers/split/cut_elements.h"
#include "tests/core/layers/split_meshes.h"

namespace varimesh::detail {
namespace {

/// The parts of a cell that is cut along an axis have as many points as a lattice would have.
TEST(CutPattern, SharesPointsBetweenParts) {
  const auto points = [](Shape shape, int order, std::vector<std::size_t> axes, std::vector<int> parts) {
    std::vector<CutAxis> chosen;
    for (const std::size_t axis : axes) chosen.push_back(cut_axes(shape)[axis]);
    return make_pattern(shape, order, chosen, std::move(parts)).points.size();
  };
  EXPECT_EQ(points(Shape::Line, 3, {0}, {4}), 13U);
  EXPECT_EQ(points(Shape::Quadrilateral, 3, {1}, {4}), 4U * 13);
  EXPECT_EQ(points(Shape::Quadrilateral, 2, {0, 1}, {4, 3}), 9U * 7);
  EXPECT_EQ(points(Shape::Triangle, 2, {1}, {3}), 1U + 4 + 7);
  EXPECT_EQ(points(Shape::Prism, 2, {0}, {3}), 6U * 7);
  EXPECT_EQ(points(Shape::Prism, 2, {0, 2}, {3, 2}), (1U + 3 + 5) * 7);
  EXPECT_EQ(points(Shape::Hexahedron, 2, {0, 1, 2}, {2, 3, 4}), 5U * 7 * 9);
  EXPECT_EQ(points(Shape::Pyramid, 2, {0}, {3}), 1U + 4 * 2 + 7 * 3);
  EXPECT_EQ(points(Shape::Tetrahedron, 2, {0}, {3}), 1U + 1 + 1 + 2 * 4 + 7);
}

/// Places along lines are those that the basis of the whole element gives.
TEST(ElementCutter, PlacesNodesOnLinesAsByTheBasis) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= 6; ++order) {
      const HighOrderMesh mesh = bent(box(shape, 1, 1, 1), order, 0.1);
      const Team team(1);
      team.run([&] {
        const Topology topology = varimesh::topology(mesh, Topology::Faces::None, team);
        const Sheets sheets(mesh, topology);
        const auto checked = check_mesh(mesh, CheckFor::Judging, Team(1));
        ASSERT_TRUE(checked);
        const std::vector<std::string> walls{"7"};
        const auto wall = find_wall_columns(*checked, walls, 1);
        ASSERT_TRUE(wall);
        LayerSplitReport report;
        const auto cuts = cut_layers(mesh, topology, sheets, *wall, geometric(4, 1.6, LayerSpacing::Graded), report);
        ASSERT_TRUE(cuts);
        ElementCutter cutter(mesh, topology, *cuts);
        for (const ElementBlock& block : mesh.blocks) {
          if (block.shape != shape || reference::info(shape).dimension != mesh.dimension) continue;
          const auto cut = cutter.cut(block, 0);
          ASSERT_TRUE(cut && cut->pattern != nullptr);
          ASSERT_FALSE(cut->pattern->lines.empty());
          const std::span<const std::int32_t> nodes(block.nodes.data(), block.nodes.size() / block.size());
          const auto fast = cutter.places(*cut, nodes), plain = cutter.places_by_basis(*cut, nodes);
          ASSERT_EQ(fast.size(), plain.size());
          for (std::size_t i = 0; i < fast.size(); ++i) EXPECT_NEAR(fast[i], plain[i], 1e-13);
        }
      });
    }
}

}  // namespace
}  // namespace varimesh::detail
