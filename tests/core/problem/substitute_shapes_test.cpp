// Which cells need a substitute for their straight-sided shape, and what they get.
#include "core/problem/substitute_shapes.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>

#include "core/problem/node_conversion.h"
#include "core/problem/targets.h"
#include "core/validity/certifier.h"
#include "tests/core/support/curved_strip.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

SubstituteShapes substitutes_of(const HighOrderMesh& mesh, int threads = 1) {
  const Team team(threads);
  SubstituteShapes result;
  team.run([&] {
    result = substitute_shapes(mesh, facets(mesh, team),
                               Certifier(mesh).sound_with_straight_sides(mesh.coordinates, team), team);
  });
  return result;
}

double area(const SubstituteShapes::Vertices& x) {
  return ((x[1][0] - x[0][0]) * (x[2][1] - x[0][1]) - (x[2][0] - x[0][0]) * (x[1][1] - x[0][1])) / 2;
}

double length(const SubstituteShapes::Vertices& x, std::size_t a, std::size_t b) {
  return std::hypot(x[a][0] - x[b][0], x[a][1] - x[b][1], x[a][2] - x[b][2]);
}

/// The targets of a mesh with these substitutes.
Problem with_targets(const HighOrderMesh& mesh, const SubstituteShapes& substitutes) {
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  const Frame frame = frame_of(mesh);
  problem.positions = solver_positions(mesh, frame);
  set_targets(problem, {}, frame.diagonal, substitutes);
  return problem;
}

TEST(SubstituteShapes, AreRegularAndEncloseWhatTheCurvedCellEncloses) {
  const HighOrderMesh mesh = testing::curved_strip(1.1, 6);
  const SubstituteShapes found = substitutes_of(mesh);
  ASSERT_EQ(found.cells, (std::vector<std::int32_t>{1, 3}));
  // A curved triangle is the triangle (angle, radius) under the polar map: its area is ∫∫ r dr dφ.
  const double width = 3.14159265358979323846 / 3, height = 0.1;
  const double expected = width * height / 2 * (1 + 2 * height / 3);
  for (const SubstituteShapes::Vertices& x : found.vertices) {
    EXPECT_NEAR(area(x), expected, 1e-5 * expected);
    EXPECT_NEAR(length(x, 0, 1), length(x, 1, 2), 1e-12);
    EXPECT_NEAR(length(x, 0, 1), length(x, 2, 0), 1e-12);
  }
  EXPECT_EQ(found.of(0), nullptr);
  EXPECT_EQ(found.of(3), &found.vertices[1]);
}

TEST(SubstituteShapes, AreMirroredInAClockwiseMesh) {
  HighOrderMesh mesh = testing::curved_strip(1.1, 3);
  testing::move_nodes(mesh, [](Place p) { return Place{-p[0], p[1], p[2]}; });
  const SubstituteShapes found = substitutes_of(mesh);
  ASSERT_EQ(found.cells, (std::vector<std::int32_t>{1, 3}));
  for (const SubstituteShapes::Vertices& x : found.vertices) EXPECT_LT(area(x), 0);
}

TEST(SubstituteShapes, HaveTheirNeighboursVolumeIfTheCurvedCellIsInvertedToo) {
  // Four triangles around a vertex that lies beyond the side of the square.
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {3, 3, 1}, 1, [](Place p) {
    const bool moved = std::abs(p[0] - 1.0 / 3) < 0.1 && std::abs(p[1] - 1.0 / 3) < 0.1;
    return moved ? Place{0.75, 0.4, 0} : p;
  });
  const SubstituteShapes found = substitutes_of(mesh);
  ASSERT_FALSE(found.cells.empty());
  for (const SubstituteShapes::Vertices& x : found.vertices) {
    EXPECT_GT(area(x), 0.01);
    EXPECT_LT(area(x), 0.3);
  }
}

TEST(SubstituteShapes, EveryShapeAndOrderGetsItsRegularShape) {
  for (const Shape shape : testing::kCellShapes)
    for (const int order : {1, 2, 4}) {
      const int d = reference::info(shape).dimension;
      // One sound cell and one that is turned inside out.
      HighOrderMesh mesh = testing::empty_mesh(shape, order);
      for (const double sign : {1.0, 1.0, -1.0})
        testing::add_cell(mesh, shape, [&](Place p) { return Place{sign * p[0], p[1], p[2]}; });
      const SubstituteShapes found = substitutes_of(mesh);
      ASSERT_EQ(found.cells, (std::vector<std::int32_t>{2})) << testing::name(shape);
      const double edge = length(found.vertices[0], 0, 1);
      for (const auto& ends : reference::info(shape).edges)
        EXPECT_NEAR(length(found.vertices[0], std::size_t(ends[0]), std::size_t(ends[1])), edge, 1e-12);
      // Its target has the volume and the orientation of the sound ones.
      const Problem problem = with_targets(mesh, found);
      const CellSet& set = problem.sets[0];
      const auto volume = [&](std::int32_t cell) {
        return std::accumulate(set.measure_of(cell), set.measure_of(cell) + (set.affine ? 1 : set.stride), 0.0);
      };
      const auto last = std::int32_t(std::ranges::find(set.mesh_cell, 2) - set.mesh_cell.begin());
      EXPECT_NEAR(volume(last), volume(last == 0 ? 1 : 0), 1e-12) << testing::name(shape) << order;
      Eigen::MatrixXd inverse(d, d);
      for (int i = 0; i < d; ++i)
        for (int j = 0; j < d; ++j)
          inverse(i, j) = set.inverse_target_of(last)[(i * d + j) * (set.affine ? 1 : set.stride)];
      EXPECT_GT(inverse.determinant(), 0) << testing::name(shape);
    }
}

TEST(SubstituteShapes, AreNotForThinCellsOfABoundaryLayer) {
  for (const Filling filling : testing::kFillings) {
    const int last = testing::is_plane(filling) ? 1 : 2;
    HighOrderMesh mesh = testing::grid(filling, {3, 3, 3}, 3, [&](Place p) {
      p[std::size_t(last)] *= 1e-5;
      return p;
    });
    EXPECT_TRUE(substitutes_of(mesh).cells.empty()) << testing::name(filling);
  }
}

TEST(SubstituteShapes, LeaveTheTargetsOfOtherCellsBitForBit) {
  HighOrderMesh mesh = testing::grid(Filling::MixedSolid, {3, 3, 3}, 2, testing::bent(3));
  testing::shake(mesh, 0.25, 4, testing::Shaken::AllInterior);
  const SubstituteShapes found = substitutes_of(mesh);
  ASSERT_GT(found.cells.size(), 3U);
  ASSERT_LT(found.cells.size(), mesh.element_count(3) - 3);
  const Problem plain = with_targets(mesh, {}), problem = with_targets(mesh, found);
  for (std::size_t b = 0; b < plain.sets.size(); ++b) {
    const CellSet &before = plain.sets[b], &after = problem.sets[b];
    const std::size_t points = before.affine ? 1 : std::size_t(before.stride);
    for (std::int32_t cell = 0; cell < before.count; ++cell) {
      const bool same = std::equal(before.inverse_target_of(cell), before.inverse_target_of(cell) + 9 * points,
                                   after.inverse_target_of(cell)) &&
                        std::equal(before.measure_of(cell), before.measure_of(cell) + points, after.measure_of(cell));
      EXPECT_EQ(same, found.of(before.mesh_cell[std::size_t(cell)]) == nullptr);
    }
  }
}

TEST(SubstituteShapes, AreTheSameForEveryNumberOfThreads) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {6, 6, 6}, 2);
  testing::shake(mesh, 0.1, 4, testing::Shaken::AllInterior);
  const SubstituteShapes one = substitutes_of(mesh), four = substitutes_of(mesh, 4);
  ASSERT_FALSE(one.cells.empty());
  EXPECT_EQ(one.cells, four.cells);
  EXPECT_EQ(one.vertices, four.vertices);
}

}  // namespace
}  // namespace varimesh
