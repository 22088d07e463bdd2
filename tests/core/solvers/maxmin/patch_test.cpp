// A patch of every shape is raised from invalid to a good scaled Jacobian, as far as a plain search comes, and with the
// same bits for any number of threads.
#include "core/solvers/maxmin/patch.h"

#include <gtest/gtest.h>

#include <map>
#include <numeric>

#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

SampleTable table(Shape shape, int order, int dimension) {
  return {shape, order, dimension, reference::uniform_lattice(shape, 2 * order + 2)};
}

/// All cells of a mesh as one patch.
struct Whole {
  explicit Whole(const HighOrderMesh& mesh) : cells(mesh, mesh.dimension) {
    const std::vector<bool> fixed = fixed_nodes(mesh);
    for (std::size_t n = 0; n < fixed.size(); ++n)
      if (!fixed[n]) free.push_back(static_cast<std::int32_t>(n));
    for (const Cells::Range& range : cells.ranges())
      tables.emplace(range.block->shape, table(range.block->shape, mesh.order, mesh.dimension));
    for (std::size_t c = 0; c < cells.count(); ++c) {
      MaxMinPatch::Cell cell;
      cell.number = static_cast<std::int32_t>(c);
      cell.shape = cells.shape(c);
      cell.nodes = cells.nodes(c);
      cell.samples = &tables.at(cell.shape);
      all.push_back(cell);
    }
  }

  MaxMinPatch::Levels raise(HighOrderMesh& mesh, double aim, int threads = 1) const {
    const Team team(threads);
    MaxMinPatch::Levels levels;
    team.run([&] {
      MaxMinPatch patch(all, free, mesh.dimension, mesh.coordinates);
      levels = patch.raise(mesh.coordinates, aim, team);
    });
    return levels;
  }

  Cells cells;
  std::vector<std::int32_t> free;
  std::map<Shape, SampleTable> tables;
  std::vector<MaxMinPatch::Cell> all;
};

double least(const std::vector<double>& values) { return *std::ranges::min_element(values); }

class MaxMinShapes : public ::testing::TestWithParam<Filling> {};

TEST_P(MaxMinShapes, MakesShakenCellsGood) {
  HighOrderMesh mesh = testing::grid(GetParam(), {2, 2, 2}, 3);
  const std::vector<double> straight = mesh.coordinates;
  const std::vector<bool> fixed = fixed_nodes(mesh);
  testing::shake(mesh, testing::is_plane(GetParam()) ? 0.12 : 0.04, 5);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (fixed[n]) std::copy_n(straight.data() + 3 * n, 3, mesh.coordinates.data() + 3 * n);
  const std::vector<double> shaken = mesh.coordinates;
  const Whole whole(mesh);
  ASSERT_LT(least(whole.raise(mesh, -10).scaled_jacobian), 0);  // an aim that is reached already: nothing moves
  EXPECT_EQ(mesh.coordinates, shaken);
  const MaxMinPatch::Levels levels = whole.raise(mesh, 0.2);
  EXPECT_GE(least(levels.scaled_jacobian), 0.2);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t c = 0; fixed[n] && c < 3; ++c) EXPECT_EQ(mesh.coordinates[3 * n + c], straight[3 * n + c]);
}

TEST_P(MaxMinShapes, IsTheSameForAnyNumberOfThreads) {
  HighOrderMesh one = testing::grid(GetParam(), {2, 2, 2}, 2);
  testing::shake(one, 0.12, 3);
  HighOrderMesh three = one;
  Whole(one).raise(one, 0.4);
  Whole(three).raise(three, 0.4, 3);
  EXPECT_EQ(one.coordinates, three.coordinates);
}

INSTANTIATE_TEST_SUITE_P(All, MaxMinShapes,
                         ::testing::Values(Filling::Triangles, Filling::Quadrilaterals, Filling::Tetrahedra,
                                           Filling::Prisms, Filling::Hexahedra),
                         [](const auto& info) { return testing::name(info.param); });

TEST(MaxMinPatch, FindsTheBestPlaceOfOneNode) {
  // The one free vertex of four quadrilaterals in a square. By symmetry, the smallest of their scaled Jacobians is
  // greatest if the vertex is in the centre.
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {2, 2, 1}, 1);
  const Whole whole(mesh);
  ASSERT_EQ(whole.free.size(), 1U);
  double* centre = mesh.coordinates.data() + 3 * whole.free[0];
  const double x = centre[0], y = centre[1];
  centre[0] += 0.21;
  centre[1] -= 0.13;
  whole.raise(mesh, 2);  // an aim that no cell reaches
  EXPECT_NEAR(centre[0], x, 2e-3);
  EXPECT_NEAR(centre[1], y, 2e-3);
}

/// A swap may propose a cell with all vertices in one place.
TEST(MaxMinPatch, LeavesCellsThatHaveCollapsed) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 1}, 2);
  const Whole whole(mesh);
  std::ranges::fill(mesh.coordinates, 0.0);
  whole.raise(mesh, 0.5);
  EXPECT_EQ(mesh.coordinates, std::vector<double>(mesh.coordinates.size(), 0.0));
}

TEST(MaxMinPatch, LetsShiftedCellsNotHoldTheOthers) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {3, 3, 1}, 2);
  testing::shake(mesh, 0.12, 11);
  Whole whole(mesh);
  const Team team(1);
  MaxMinPatch::Levels levels;
  team.run(
      [&] { levels = MaxMinPatch(whole.all, whole.free, 2, mesh.coordinates).look_at_cells(mesh.coordinates, team); });
  const auto lowest = std::ranges::min_element(levels.level) - levels.level.begin();
  EXPECT_DOUBLE_EQ(levels.smallest, levels.level[static_cast<std::size_t>(lowest)]);
  for (MaxMinPatch::Cell& cell : whole.all)
    if (cell.number == MaxMinPatch(whole.all, whole.free, 2, mesh.coordinates).cells()[std::size_t(lowest)].number)
      cell.shift = 5;
  MaxMinPatch::Levels shifted;
  team.run(
      [&] { shifted = MaxMinPatch(whole.all, whole.free, 2, mesh.coordinates).look_at_cells(mesh.coordinates, team); });
  EXPECT_GT(shifted.smallest, levels.smallest);
  EXPECT_EQ(shifted.level, levels.level);
}

}  // namespace
}  // namespace varimesh
