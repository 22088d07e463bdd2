// What the solver works on: every cell once, the tables of its shape, and the cells of every free node.
#include "core/problem/problem.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

class BuildProblem : public ::testing::TestWithParam<Filling> {
 protected:
  HighOrderMesh mesh_ = testing::grid(GetParam(), {4, 3, 2}, 3);
  std::vector<bool> fixed_ = fixed_nodes(mesh_);
  Problem problem_ = build_problem(mesh_, fixed_, 0);
};

INSTANTIATE_TEST_SUITE_P(Fillings, BuildProblem, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(BuildProblem, HasEveryCellOnceWithItsNodes) {
  const Cells cells(mesh_, mesh_.dimension);
  ASSERT_EQ(problem_.cells, std::int32_t(cells.count()));
  std::vector<int> seen(cells.count(), 0);
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      const auto number = std::size_t(set.mesh_cell[std::size_t(cell)]);
      ++seen[number];
      EXPECT_EQ(set.shape, cells.shape(number));
      const std::int32_t* nodes = set.nodes.data() + cell * set.nodes_per_cell;
      EXPECT_TRUE(std::ranges::equal(cells.nodes(number), std::span(nodes, std::size_t(set.nodes_per_cell))));
    }
  EXPECT_EQ(std::ranges::count(seen, 1), problem_.cells);
}

TEST_P(BuildProblem, HasOneSetForEachShape) {
  std::set<Shape> shapes;
  std::int32_t first = 0;
  for (const CellSet& set : problem_.sets) {
    EXPECT_TRUE(shapes.insert(set.shape).second);
    EXPECT_EQ(set.first, first);
    EXPECT_EQ(set.affine, set.shape == Shape::Triangle || set.shape == Shape::Tetrahedron);
    first += set.count;
  }
  EXPECT_EQ(first, problem_.cells);
}

TEST_P(BuildProblem, KeepsCellsOfOneClusterTogether) {
  for (const CellSet& set : problem_.sets)
    EXPECT_TRUE(std::is_sorted(problem_.cluster.begin() + set.first, problem_.cluster.begin() + set.first + set.count));
  EXPECT_EQ(*std::ranges::max_element(problem_.cluster) + 1, problem_.clusters);
}

TEST_P(BuildProblem, HasTheBasisAtTheQuadraturePoints) {
  for (const CellSet& set : problem_.sets) {
    const reference::Quadrature rule = reference::quadrature(set.shape, 3, 6);
    const auto gradients =
        reference::basis_gradients(set.shape, 3, reference::NodeSet::Optimised, set.dimension, rule.points);
    EXPECT_EQ(set.degree, 6) << "twice the order";
    ASSERT_EQ(set.points, rule.weights.size());
    EXPECT_EQ(set.stride % kPointPadding, 0);
    EXPECT_LT(set.stride - set.points, kPointPadding);
    for (int q = 0; q < set.stride; ++q) {
      // The padding repeats the last point with weight 0.
      const int point = std::min(q, set.points - 1);
      EXPECT_EQ(set.weights[std::size_t(q)], q < set.points ? rule.weights[q] : 0.0);
      for (int n = 0; n < set.nodes_per_cell; ++n)
        for (int k = 0; k < set.dimension; ++k)
          EXPECT_EQ(set.derivatives_of(n)[k * set.stride + q], gradients[std::size_t(k)](point, n));
    }
  }
}

TEST_P(BuildProblem, ListsTheCellsOfEveryFreeNode) {
  // The plain way: every place of every node in every cell.
  std::vector<std::set<std::tuple<int, int, int>>> places(mesh_.node_count());
  for (std::size_t b = 0; b < problem_.sets.size(); ++b)
    for (std::int32_t cell = 0; cell < problem_.sets[b].count; ++cell)
      for (int n = 0; n < problem_.sets[b].nodes_per_cell; ++n) {
        const auto node = std::size_t(problem_.sets[b].nodes[std::size_t(cell * problem_.sets[b].nodes_per_cell + n)]);
        places[node].insert({int(b), cell, n});
      }
  EXPECT_EQ(std::ptrdiff_t(problem_.free.size()), std::ranges::count(fixed_, false));
  ASSERT_EQ(problem_.offsets.size(), problem_.free.size() + 1);
  for (std::size_t rank = 0; rank < problem_.free.size(); ++rank) {
    const auto node = std::size_t(problem_.free[rank]);
    EXPECT_FALSE(fixed_[node]);
    std::set<std::tuple<int, int, int>> listed;
    for (std::int64_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
      const Incidence& at = problem_.incidences[std::size_t(i)];
      listed.insert({at.set, at.cell, at.local});
    }
    EXPECT_EQ(listed, places[node]);
    EXPECT_EQ(std::size_t(problem_.offsets[rank + 1] - problem_.offsets[rank]), listed.size()) << "each is listed once";
  }
}

TEST(BuildProblemWith, TheQuadratureDegreeAskedFor) {
  const HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {1, 1, 1}, 2);
  EXPECT_EQ(build_problem(mesh, fixed_nodes(mesh), 0).sets[0].points,
            reference::quadrature(Shape::Tetrahedron, 2, 4).weights.size());
  EXPECT_EQ(build_problem(mesh, fixed_nodes(mesh), 7).sets[0].points,
            reference::quadrature(Shape::Tetrahedron, 2, 7).weights.size());
}

TEST(HoldDeformation, SaysWhetherItsRoomIsNew) {
  const HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2);
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  EXPECT_FALSE(holds_deformation(problem));
  EXPECT_TRUE(hold_deformation(problem, false));
  EXPECT_TRUE(holds_deformation(problem));
  EXPECT_FALSE(hold_deformation(problem, false));
  EXPECT_TRUE(hold_deformation(problem, true)) << "there is new room for the function of J";
  EXPECT_FALSE(hold_deformation(problem, true));
  EXPECT_FALSE(hold_deformation(problem, false));
  EXPECT_TRUE(problem.sets[0].jacobian_function.empty());
  drop_deformation(problem);
  EXPECT_FALSE(holds_deformation(problem));
  EXPECT_EQ(problem.sets[0].deformation_of(0), nullptr);
}

TEST(FreePositions, AreTakenFromAnArrayOfAllAndPutBack) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {3, 3, 0}, 2);
  const Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  std::vector<double> all(2 * mesh.node_count());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = double(i);
  std::vector<double> free = free_positions(problem, all);
  ASSERT_EQ(free.size(), 2 * problem.free.size());
  for (std::size_t f = 0; f < problem.free.size(); ++f) {
    EXPECT_EQ(free[2 * f], 2 * problem.free[f]);
    EXPECT_EQ(free[2 * f + 1], 2 * problem.free[f] + 1);
  }
  std::vector<double> other(all.size(), -1.0);
  ASSERT_TRUE(set_free_positions(problem, free, other));
  EXPECT_EQ(free_positions(problem, other), free);
  EXPECT_EQ(std::ranges::count(other, -1.0), std::ptrdiff_t(all.size() - free.size())) << "fixed nodes keep theirs";
  free.pop_back();
  EXPECT_FALSE(set_free_positions(problem, free, other));
}

}  // namespace
}  // namespace varimesh
