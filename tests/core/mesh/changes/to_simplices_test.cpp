// Cells cut into simplices: conforming, valid and of the same volume, split layers included.
#include "core/mesh/changes/to_simplices.h"

#include <gtest/gtest.h>

#include "core/quality/quality.h"
#include "tests/core/layers/split_meshes.h"

namespace varimesh {
namespace {

/// Numbers the vertices of a mesh of order 1 anew, so that cells meet with their lowest vertices anywhere.
HighOrderMesh shuffled(const HighOrderMesh& mesh, std::size_t step) {
  HighOrderMesh result = mesh;
  const std::size_t count = mesh.node_count();
  std::vector<std::int32_t> place(count);
  for (std::size_t n = 0; n < count; ++n) place[n] = static_cast<std::int32_t>(n * step % count);
  for (std::size_t n = 0; n < count; ++n)
    std::copy_n(&mesh.coordinates[3 * n], 3, &result.coordinates[3 * at(place[n])]);
  for (ElementBlock& block : result.blocks)
    for (std::int32_t& node : block.nodes) node = place[at(node)];
  return result;
}

TEST(Simplices, ConformAndFillTheSameVolume) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= 4; ++order)
      for (const std::size_t step : {1U, 7U, 11U, 29U}) {
        const HighOrderMesh straight = box(shape, 3, 2, 2);
        const HighOrderMesh mesh = bent(shuffled(straight, step), order);
        const auto cut = to_simplices(mesh);
        ASSERT_TRUE(cut);
        const Expected<void> checked = check_structure(*cut);
        ASSERT_TRUE(checked) << checked.error().sentence;
        EXPECT_EQ(quality(*cut).certified.valid, static_cast<std::int64_t>(cut->element_count(cut->dimension)));
        EXPECT_NEAR(volume(*cut), volume(mesh), 2e-3 * volume(mesh));
        EXPECT_EQ(cut->coordinates, mesh.coordinates);
        const std::size_t each = shape == Shape::Quadrilateral ? 2 : shape == Shape::Prism ? 3 : 6;
        EXPECT_EQ(cut->element_count(cut->dimension), each * mesh.element_count(mesh.dimension));
        for (const ElementBlock& block : cut->blocks) EXPECT_TRUE(reference::info(block.shape).affine);
      }
}

/// Straight cells with flat faces become straight simplices, so not even rounding errors change the volume.
TEST(Simplices, AreExactInStraightCells) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron}) {
    const HighOrderMesh mesh = *change_order(box(shape, 3, 2, 2), 3);
    EXPECT_NEAR(volume(*to_simplices(mesh)), 1, 1e-13);
  }
}

TEST(Simplices, OfLayersAreCertified) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron}) {
    const auto layers = split(bent(box(shape, 4, 1, 3), 3), geometric(6, 2, LayerSpacing::Graded));
    ASSERT_TRUE(layers);
    const auto cut = to_simplices(layers->mesh);
    ASSERT_TRUE(cut);
    EXPECT_TRUE(check_structure(*cut));
    EXPECT_EQ(quality(*cut).certified.valid, static_cast<std::int64_t>(cut->element_count(cut->dimension)));
  }
}

TEST(Simplices, StandOnPyramidsToo) {
  const std::vector<Place> places{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},    {0, 0, 1},
                                  {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {2, 0.5, 0.5}};
  const HighOrderMesh mesh =
      bent(small_mesh(places, {{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}}, {Shape::Pyramid, {1, 2, 6, 5, 8}}},
                      [](const Place&) { return 8; }),
           3, 0.02);
  const auto cut = to_simplices(mesh);
  ASSERT_TRUE(cut);
  EXPECT_EQ(cut->element_count(3), 8U);
  EXPECT_TRUE(check_structure(*cut));
  EXPECT_EQ(quality(*cut).certified.valid, 8);
}

/// The vertices of one side have the opposite order, so without the masters the diagonals would cross.
TEST(Simplices, HaveTheSameTrianglesOnPeriodicSides) {
  HighOrderMesh mesh = box(Shape::Hexahedron, 1, 2, 2);
  const std::size_t count = mesh.node_count();
  // The nodes with x = 1 get the order of those with x = 0, reversed.
  std::vector<std::int32_t> left, right;
  for (std::size_t n = 0; n < count; ++n) (mesh.coordinates[3 * n] < 0.5 ? left : right).push_back(std::int32_t(n));
  std::vector<std::int32_t> place(count);
  for (const std::int32_t n : left) place[at(n)] = n;
  for (std::size_t i = 0; i < right.size(); ++i) place[at(right[i])] = right[right.size() - 1 - i];
  HighOrderMesh turned = mesh;
  for (std::size_t n = 0; n < count; ++n)
    std::copy_n(&mesh.coordinates[3 * n], 3, &turned.coordinates[3 * at(place[n])]);
  for (ElementBlock& block : turned.blocks)
    for (std::int32_t& node : block.nodes) node = place[at(node)];
  PeriodicLink link;
  link.dimension = 2;
  for (std::size_t i = 0; i < right.size(); ++i) link.nodes.emplace_back(place[at(right[i])], left[i]);
  turned.periodic = {link};
  const std::map<std::int32_t, std::int32_t> master(link.nodes.begin(), link.nodes.end());
  const auto cut = to_simplices(turned);
  ASSERT_TRUE(cut);
  std::set<std::set<std::int32_t>> low, high;
  for (const ElementBlock& block : cut->blocks)
    for (std::size_t e = 0; block.shape == Shape::Triangle && e < block.size(); ++e) {
      const std::set<std::int32_t> nodes(&block.nodes[3 * e], &block.nodes[3 * e] + 3);
      const auto all_at = [&](double x) {
        return std::ranges::all_of(nodes, [&](std::int32_t n) { return cut->coordinates[3 * at(n)] == x; });
      };
      if (all_at(0)) low.insert(nodes);
      std::set<std::int32_t> masters;
      if (all_at(1))
        for (const std::int32_t n : nodes) masters.insert(master.at(n));
      if (all_at(1)) high.insert(masters);
    }
  EXPECT_EQ(low.size(), 8U);
  EXPECT_EQ(low, high);
}

}  // namespace
}  // namespace varimesh
