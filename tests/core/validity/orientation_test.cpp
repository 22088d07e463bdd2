// Which cells are numbered clockwise: their neighbours and the enclosed volume tell, not their own geometry.
#include "core/validity/orientation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/core/support/curved_strip.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/turned.h"

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

/// One cell that is half of a ring; mirrored if `sense` is −1. Its vertices lie on one line, or in space in one plane,
/// up to rounding.
HighOrderMesh half_ring(Shape shape, double sense) {
  return testing::one_cell(shape, 6, [&](Place p) {
    const double radius = 1.5 + p[0] / 2, angle = std::acos(-1.0) * (1 + p[1]) / 2;
    return Place{radius * std::cos(angle), sense * radius * std::sin(angle), p[2]};
  });
}

TEST(Orientation, DoesNotGoByTheRoundingOfAFlatCell) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron})
    for (const double sense : {1.0, -1.0}) EXPECT_EQ(orientation(half_ring(shape, sense)), 1);
}

/// The clockwise cells, with facets of the mesh itself.
std::vector<char> found(const HighOrderMesh& mesh, const Team& team = Team(1)) {
  return clockwise_cells(mesh, facets(mesh, team), team);
}

TEST(ClockwiseCells, AreFoundAmongAllShapesAndOrders) {
  for (const testing::Filling filling : testing::kFillings)
    for (int order = 1; order <= 4; ++order) {
      const HighOrderMesh mesh = testing::grid(filling, {4, 2, 2}, order, testing::bent(3, 0.03));
      EXPECT_TRUE(found(mesh).empty()) << testing::name(filling);
      for (const auto& chosen : {testing::every_cell, testing::every_third_cell}) {
        HighOrderMesh mirrored = testing::turned(mesh, chosen);
        const std::vector<char> clockwise = found(mirrored);
        EXPECT_EQ(clockwise, testing::cells_that(mesh, chosen)) << testing::name(filling) << " of order " << order;
        turn_cells(mirrored, clockwise);
        EXPECT_EQ(testing::nodes_of_blocks(mirrored), testing::nodes_of_blocks(mesh));
      }
    }
}

TEST(ClockwiseCells, AreNoCellsThatAreOnlyInverted) {
  for (const testing::Filling filling : testing::kFillings)
    for (const double amount : {0.5, 3.0}) {
      HighOrderMesh mesh = testing::grid(filling, {4, 4, 4}, 1);
      testing::shake(mesh, amount, 2, testing::Shaken::AllInterior);
      EXPECT_TRUE(found(mesh).empty()) << testing::name(filling);
      EXPECT_EQ(found(testing::turned(mesh, testing::every_third_cell)),
                testing::cells_that(mesh, testing::every_third_cell))
          << testing::name(filling);
      for (std::size_t i = 0; i < mesh.coordinates.size(); i += 3) mesh.coordinates[i] *= -1;
      EXPECT_EQ(found(mesh), testing::cells_that(mesh, testing::every_cell)) << testing::name(filling);
    }
}

TEST(ClockwiseCells, AreFewThoughMostCellsAreInverted) {
  // The inner vertices of three by three squares are drawn far out.
  HighOrderMesh mesh = testing::grid(testing::Filling::Quadrilaterals, {3, 3, 1}, 1);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = mesh.coordinates.data() + 3 * n;
    const bool inner = x[0] > 0.1 && x[0] < 0.9 && x[1] > 0.1 && x[1] < 0.9;
    for (int c = 0; c < 2 && inner; ++c) x[c] = 0.5 + 8 * (x[c] - 0.5);
  }
  EXPECT_EQ(orientation(mesh), 1) << "the volume decides, not the number of cells";
  EXPECT_TRUE(found(mesh).empty());
}

TEST(ClockwiseCells, AreJudgedByTheirCurvedSides) {
  // The middle triangle of the strip is inverted with straight sides, and valid as it is.
  HighOrderMesh mesh = testing::curved_strip(1.02, 3, 2);
  ElementBlock& block = mesh.blocks[0];
  block.numbers = {2};
  block.nodes = {block.nodes.begin() + 10, block.nodes.begin() + 20};
  EXPECT_EQ(orientation(mesh), 1) << "straight sides do not decide";
  EXPECT_TRUE(found(mesh).empty());
}

TEST(ClockwiseCells, AreJudgedByTheirCurvedSidesIfTheyAreFlatWithoutThem) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron}) {
    EXPECT_TRUE(found(half_ring(shape, 1)).empty());
    EXPECT_EQ(found(half_ring(shape, -1)).size(), 1U);
  }
}

TEST(ClockwiseCells, AreJudgedApartFromCellsThatAreNotJoinedToThem) {
  for (const Shape shape : testing::kCellShapes) {
    const std::vector<char> first_two = {1, 1, 0, 0, 0};
    EXPECT_EQ(found(cells(shape, 5, 2)), first_two);
    EXPECT_EQ(found(cells(shape, 5, 5)), std::vector<char>(5, 1));
  }
}

TEST(ClockwiseCells, AreNoneOfAStripThatHasNoSense) {
  // A Möbius strip of five triangles, laid flat: (0 1 2), (1 2 3), …, (4 0 1).
  HighOrderMesh mesh = testing::empty_mesh(Shape::Triangle, 1);
  ElementBlock& block = mesh.blocks.emplace_back();
  block.shape = Shape::Triangle;
  for (int i = 0; i < 5; ++i) {
    for (const double x : {std::cos(1.2566 * i), std::sin(1.2566 * i), 0.0}) mesh.coordinates.push_back(x);
    mesh.node_numbers.push_back(i + 1);
    block.numbers.push_back(i + 1);
    for (int k = 0; k < 3; ++k) block.nodes.push_back((i + k) % 5);
  }
  EXPECT_TRUE(found(mesh).empty());
}

TEST(ClockwiseCells, AreTheSameForAnyNumberOfThreads) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {16, 15, 14}, 1);
  testing::shake(mesh, 0.1, 2, testing::Shaken::AllInterior);
  const auto chosen = [](std::size_t cell) { return cell % 5000 == 0; };
  const HighOrderMesh mirrored = testing::turned(mesh, chosen);
  for (const int threads : {1, 2, 3, 8}) {
    const Team team(threads);
    team.run([&] {
      EXPECT_EQ(found(mirrored, team), testing::cells_that(mesh, chosen)) << threads << " threads";
      HighOrderMesh back = mirrored;
      turn_cells(back, found(mirrored, team), team);
      EXPECT_EQ(testing::nodes_of_blocks(back), testing::nodes_of_blocks(mesh));
      EXPECT_EQ(orientation(mesh, team), 1);
    });
  }
}

}  // namespace
}  // namespace varimesh::detail
