// The orientation of a mesh is that of most of its straight-sided cells.
#include "core/validity/orientation.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

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

TEST(NumberedAgainstMost, IsNoCellThatIsOnlyInverted) {
  for (const testing::Filling filling : testing::kFillings) {
    HighOrderMesh mesh = testing::grid(filling, {4, 4, 4}, 1);
    testing::shake(mesh, 0.5, 2, testing::Shaken::AllInterior);
    EXPECT_TRUE(numbered_against_most(mesh, facets(mesh)).empty()) << testing::name(filling);
    for (std::size_t i = 0; i < mesh.coordinates.size(); i += 3) mesh.coordinates[i] *= -1;
    EXPECT_TRUE(numbered_against_most(mesh, facets(mesh)).empty()) << testing::name(filling) << ", clockwise";
  }
}

TEST(NumberedAgainstMost, IsACellWhoseVerticesAreMirrored) {
  // Pairs of vertices whose exchange mirrors the shape.
  const std::vector<std::pair<Shape, std::vector<std::pair<int, int>>>> mirrors = {
      {Shape::Triangle, {{0, 1}}},      {Shape::Quadrilateral, {{1, 3}}}, {Shape::Tetrahedron, {{0, 1}}},
      {Shape::Prism, {{0, 1}, {3, 4}}}, {Shape::Pyramid, {{1, 3}}},       {Shape::Hexahedron, {{1, 3}, {5, 7}}}};
  for (const testing::Filling filling : testing::kFillings) {
    HighOrderMesh mesh = testing::grid(filling, {4, 4, 4}, 1);
    for (const auto& [shape, pairs] : mirrors) {
      const auto block = std::ranges::find(mesh.blocks, shape, &ElementBlock::shape);
      if (block == mesh.blocks.end() || reference::info(shape).dimension != mesh.dimension) continue;
      for (const auto& [a, b] : pairs)
        std::swap(block->nodes[static_cast<std::size_t>(a)], block->nodes[static_cast<std::size_t>(b)]);
    }
    const std::vector<char> against = numbered_against_most(mesh, facets(mesh));
    std::size_t cell = 0, blocks = 0;
    for (const ElementBlock& block : mesh.blocks) {
      if (reference::info(block.shape).dimension != mesh.dimension) continue;
      const bool first = std::ranges::find(mesh.blocks, block.shape, &ElementBlock::shape)->nodes == block.nodes;
      for (std::size_t e = 0; e < block.size(); ++e, ++cell)
        EXPECT_EQ(against[cell] != 0, first && e == 0) << testing::name(filling) << " cell " << cell;
      ++blocks;
    }
    EXPECT_GT(blocks, 0U);
  }
}

TEST(NumberedAgainstMost, IsTheSameForAnyNumberOfThreads) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {16, 15, 14}, 1);
  const auto block = std::ranges::find(mesh.blocks, Shape::Tetrahedron, &ElementBlock::shape);
  std::ptrdiff_t mirrored = 0;
  for (std::size_t e = 0; e < block->size(); e += 5000, ++mirrored)
    std::swap(block->nodes[4 * e], block->nodes[4 * e + 1]);
  const Facets known = facets(mesh);
  const std::vector<char> one = numbered_against_most(mesh, known);
  EXPECT_EQ(std::ranges::count(one, 1), mirrored);
  for (const int threads : {2, 3, 8}) {
    const Team team(threads);
    team.run([&] {
      EXPECT_EQ(numbered_against_most(mesh, known, team), one) << threads << " threads";
      EXPECT_EQ(orientation(mesh, team), 1);
    });
  }
}

}  // namespace
}  // namespace varimesh::detail
