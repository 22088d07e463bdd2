// The sizes that displacements are measured by.
#include "core/problem/sizes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

/// The sizes of all cells of a grid in the mesh's unit.
std::vector<double> cell_sizes(Filling filling, int order, const testing::Map& map) {
  const HighOrderMesh mesh = testing::grid(filling, {2, 2, 2}, order, map);
  const Problem problem = testing::make_problem(mesh);
  std::vector<double> sizes(problem.cell_size.begin(), problem.cell_size.end());
  for (double& size : sizes) size *= frame_of(mesh).diagonal;
  return sizes;
}

TEST(CellSize, OfABoxIsItsShortestEdge) {
  for (const int order : {1, 3}) {
    for (const double size : cell_sizes(Filling::Quadrilaterals, order, [](Place p) {
           return Place{2 * p[0], 6 * p[1], 0};
         }))
      EXPECT_NEAR(size, 1, 1e-6);
    for (const double size : cell_sizes(Filling::Hexahedra, order, [](Place p) {
           return Place{2e-4 * p[0] + p[1], 6 * p[1], 4 * p[2]};
         }))
      EXPECT_NEAR(size, 1e-4 * 3 / std::sqrt(9.25), 1e-9) << "sheared boxes: the height counts, not the edge";
  }
}

TEST(CellSize, OfASimplexIsItsShortestHeight) {
  // Legs 1 and 2: the heights are 2, 1, and 2/√5 above the hypotenuse.
  for (const double size : cell_sizes(Filling::Triangles, 2, [](Place p) { return Place{2 * p[0], 4 * p[1], 0}; }))
    EXPECT_NEAR(size, 2 / std::sqrt(5), 1e-6);
  // Half a face of a cube of edge 1 and its centre, 1/2 above the face: volume 1/12, the largest face is that half.
  for (const double size : cell_sizes(Filling::Tetrahedra, 2, [](Place p) {
         return Place{2 * p[0], 2 * p[1], 2 * p[2]};
       }))
    EXPECT_NEAR(size, 0.5, 1e-6);
}

TEST(CellSize, OfPrismsAndPyramidsIsTheirShortestHeight) {
  // Right triangles with legs 1, one high: 1/√2 above the hypotenuse's face. Flattened to .1: the height.
  for (const double z : {1.0, 0.1})
    for (const double size : cell_sizes(Filling::Prisms, 2, [z](Place p) {
           return Place{2 * p[0], 2 * p[1], 2 * z * p[2]};
         }))
      EXPECT_NEAR(size, std::min(z, std::sqrt(0.5)), 1e-6);
  // The centre is 1/2 above the base.
  for (const double size : cell_sizes(Filling::Pyramids, 2, [](Place p) {
         return Place{2 * p[0], 2 * p[1], 2 * p[2]};
       }))
    EXPECT_NEAR(size, 0.5, 1e-6);
}

TEST(CellSize, DoesNotDependOnTheCurve) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 3);
  const Problem straight = testing::make_problem(mesh);
  const std::size_t middle = std::size_t(straight.free.back());  // inside an element
  mesh.coordinates[3 * middle] += 0.05;
  EXPECT_EQ(testing::make_problem(mesh).cell_size, straight.cell_size);
}

TEST(CellSize, OfACellWithoutVolumeIsAMillionthOfItsExtent) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {1, 1, 0}, 1, [](Place p) { return Place{p[0], 0, 0}; });
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  problem.positions = solver_positions(mesh, frame_of(mesh));
  set_sizes(problem);
  for (const float size : problem.cell_size) EXPECT_NEAR(size, 1e-6 * 2 / 3, 1e-9);
}

TEST(NodeSize, IsTheSmallestOfItsCells) {
  // Columns that become wider by the factor 10.
  const HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {3, 2, 0}, 2, [](Place p) {
    return Place{std::pow(10, 3 * p[0]), 1000 * p[1], 0};
  });
  const Problem problem = testing::make_problem(mesh);
  const double diagonal = frame_of(mesh).diagonal;
  int seen = 0;
  for (std::size_t rank = 0; rank < problem.free.size(); ++rank) {
    const double x = mesh.coordinates[3 * std::size_t(problem.free[rank])];
    const double expected = x < 10.5 ? 9 : x < 100.5 ? 90 : 500;
    EXPECT_NEAR(1 / problem.inverse_size[rank] * diagonal, expected, 1e-3) << x;
    ++seen;
  }
  EXPECT_GT(seen, 0);
}

}  // namespace
}  // namespace varimesh
