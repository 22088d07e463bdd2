// A space of order 1 or 2 on the mesh's cells: its nodes are counted, its functions are polynomials and continuous.
#include "core/preconditioner/coarse_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "core/reference/nodes.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

TEST(CoarseSpace, HasANodeInEveryPartThatMayMove) {
  // 3 × 3 squares have 4 inner vertices, 12 inner edges and 9 squares; 3 × 3 × 3 cubes have 8 inner vertices, 36 inner
  // edges, 54 inner faces and 27 cubes.
  const Problem squares = testing::make_problem(testing::grid(Filling::Quadrilaterals, {3, 3, 0}, 4));
  EXPECT_EQ(coarse_space(squares, 1, Team(1)).count, 4);
  EXPECT_EQ(coarse_space(squares, 2, Team(1)).count, 4 + 12 + 9);
  const Problem cubes = testing::make_problem(testing::grid(Filling::Hexahedra, {3, 3, 3}, 3));
  EXPECT_EQ(coarse_space(cubes, 1, Team(1)).count, 8);
  EXPECT_EQ(coarse_space(cubes, 2, Team(1)).count, 8 + 36 + 54 + 27);
}

class CoarseSpaceOn : public ::testing::TestWithParam<Filling> {
 protected:
  Problem problem_ = testing::make_problem(testing::grid(GetParam(), {3, 3, 2}, 4));
};

INSTANTIATE_TEST_SUITE_P(Fillings, CoarseSpaceOn, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(CoarseSpaceOn, NumbersItsNodesAsTheCellsNameThem) {
  const CoarseSpace space = coarse_space(problem_, 2, Team(1));
  std::int32_t next = 0;
  std::set<std::int32_t> seen;
  for (const CoarseSpace::Set& set : space.sets)
    for (const std::int32_t node : set.nodes) {
      if (node < 0 || !seen.insert(node).second) continue;
      EXPECT_EQ(node, next++);
    }
  EXPECT_EQ(next, space.count);
}

TEST_P(CoarseSpaceOn, GivesANodeOneValueWhicheverOfItsCellsIsAsked) {
  for (const int order : {1, 2}) {
    const CoarseSpace space = coarse_space(problem_, order, Team(1));
    std::vector<double> coarse(std::size_t(space.count));
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (double& value : coarse) value = uniform(random);
    std::map<std::int32_t, double> fine;
    std::size_t again = 0;
    for (std::size_t s = 0; s < space.sets.size(); ++s) {
      const CellSet& cells = problem_.sets[s];
      const CoarseSpace::Set& set = space.sets[s];
      for (std::int32_t cell = 0; cell < cells.count; ++cell)
        for (int n = 0; n < cells.nodes_per_cell; ++n) {
          double value = 0;
          for (std::int64_t e = set.values.begin[std::size_t(n)]; e < set.values.begin[std::size_t(n) + 1]; ++e) {
            const std::int32_t node =
                set.nodes[std::size_t(cell * set.nodes_per_cell + set.values.column[std::size_t(e)])];
            if (node >= 0) value += double(set.values.factor[std::size_t(e)]) * coarse[std::size_t(node)];
          }
          const auto [found, is_new] = fine.emplace(cells.nodes[std::size_t(cell * cells.nodes_per_cell + n)], value);
          if (!is_new) ++again;
          EXPECT_NEAR(found->second, value, 1e-6);
        }
    }
    EXPECT_GT(again, 0U);
    // Fixed nodes get the value 0.
    const std::set<std::int32_t> free(problem_.free.begin(), problem_.free.end());
    for (const auto& [node, value] : fine)
      if (!free.contains(node)) {
        EXPECT_NEAR(value, 0, 1e-6);
      }
  }
}

TEST_P(CoarseSpaceOn, HoldsPolynomialsOfItsOrder) {
  for (const int order : {1, 2}) {
    const CoarseSpace space = coarse_space(problem_, order, Team(1));
    for (std::size_t s = 0; s < space.sets.size(); ++s) {
      const CellSet& cells = problem_.sets[s];
      const auto& coarse = reference::nodes(cells.shape, order, reference::NodeSet::Equispaced, cells.dimension);
      const auto& fine = reference::nodes(cells.shape, cells.order, reference::NodeSet::Optimised, cells.dimension);
      const auto polynomial = [&](const auto& at) {
        return std::pow(0.3 + 0.5 * at[0] - 0.7 * at[1] + (cells.dimension == 3 ? 0.2 * at[2] : 0.0), order);
      };
      const SparseRows& values = space.sets[s].values;
      for (Eigen::Index n = 0; n < fine.rows(); ++n) {
        double sum = 0;
        for (std::int64_t e = values.begin[std::size_t(n)]; e < values.begin[std::size_t(n) + 1]; ++e)
          sum += double(values.factor[std::size_t(e)]) * polynomial(coarse.row(values.column[std::size_t(e)]));
        EXPECT_NEAR(sum, polynomial(fine.row(n)), 1e-6);
      }
    }
  }
}

TEST_P(CoarseSpaceOn, HasAStiffnessThatConstantsDoNotFeel) {
  for (const int order : {1, 2})
    for (const CoarseSpace::Set& set : coarse_space(problem_, order, Team(1)).sets) {
      const int d = problem_.dimension, nodes = set.nodes_per_cell;
      const auto entry = [&](int a, int b, int k, int l) {
        return set.stiffness[std::size_t(((a * nodes + b) * d + k) * d + l)];
      };
      for (int a = 0; a < nodes; ++a)
        for (int k = 0; k < d; ++k)
          for (int l = 0; l < d; ++l) {
            double sum = 0;
            for (int b = 0; b < nodes; ++b) {
              sum += entry(a, b, k, l);
              EXPECT_NEAR(entry(a, b, k, l), entry(b, a, l, k), 1e-6);
            }
            EXPECT_NEAR(sum, 0, 1e-5);
          }
    }
}

TEST_P(CoarseSpaceOn, IsTheSameForAnyNumberOfThreads) {
  // 40 × 40 × 3 cells make several tasks.
  const Problem problem = testing::make_problem(testing::grid(GetParam(), {40, 40, 3}, 2));
  const CoarseSpace one = coarse_space(problem, 2, Team(1));
  const NodeCells cells = node_cells(one, Team(1));
  const NodePattern pattern = node_pattern(one, cells, true, Team(1));
  for (const int threads : {2, 3}) {
    const Team team(threads);
    team.run([&] {
      const CoarseSpace space = coarse_space(problem, 2, team);
      EXPECT_EQ(space.count, one.count);
      for (std::size_t s = 0; s < space.sets.size(); ++s) EXPECT_EQ(space.sets[s].nodes, one.sets[s].nodes);
      const NodeCells again = node_cells(space, team);
      EXPECT_EQ(again.begin, cells.begin);
      EXPECT_TRUE(std::equal(again.incidences.begin(), again.incidences.end(), cells.incidences.begin(),
                             [](const Incidence& a, const Incidence& b) {
                               return a.set == b.set && a.cell == b.cell && a.local == b.local;
                             }));
      const NodePattern same = node_pattern(space, again, true, team);
      EXPECT_EQ(same.begin, pattern.begin);
      EXPECT_EQ(same.column, pattern.column);
    });
  }
}

TEST_P(CoarseSpaceOn, ListsTheCellsOfEachNodeAndTheNodesBesideIt) {
  const CoarseSpace space = coarse_space(problem_, 2, Team(1));
  std::vector<std::vector<std::array<int, 3>>> cells(std::size_t(space.count));
  std::vector<std::set<std::int32_t>> beside(std::size_t(space.count));
  for (std::size_t s = 0; s < space.sets.size(); ++s) {
    const int per_cell = space.sets[s].nodes_per_cell;
    for (int cell = 0; cell < problem_.sets[s].count; ++cell)
      for (int a = 0; a < per_cell; ++a) {
        const std::int32_t node = space.sets[s].nodes[std::size_t(cell * per_cell + a)];
        if (node < 0) continue;
        cells[std::size_t(node)].push_back({int(s), cell, a});
        for (int b = 0; b < per_cell; ++b) {
          const std::int32_t other = space.sets[s].nodes[std::size_t(cell * per_cell + b)];
          if (other >= 0 && other != node) beside[std::size_t(node)].insert(other);
        }
      }
  }
  const NodeCells listed = node_cells(space, Team(1));
  const NodePattern pattern = node_pattern(space, listed, false, Team(1));
  for (std::size_t node = 0; node < cells.size(); ++node) {
    std::vector<std::array<int, 3>> own;
    for (std::int64_t p = listed.begin[node]; p < listed.begin[node + 1]; ++p) {
      const Incidence& in = listed.incidences[std::size_t(p)];
      own.push_back({in.set, in.cell, in.local});
    }
    EXPECT_EQ(own, cells[node]);
    const std::vector<std::int32_t> row(pattern.column.begin() + pattern.begin[node],
                                        pattern.column.begin() + pattern.begin[node + 1]);
    EXPECT_EQ(row, std::vector<std::int32_t>(beside[node].begin(), beside[node].end()));
  }
}

TEST(CoarseSpace, HasTheStiffnessOfTheReferenceTriangle) {
  // ∇φ of the vertices (−1, −1), (1, −1), (−1, 1): (−1/2, −1/2), (1/2, 0), (0, 1/2).
  const HighOrderMesh mesh = testing::one_cell(Shape::Triangle, 2, [](testing::Place p) { return p; });
  const CoarseSpace space = coarse_space(testing::make_problem(mesh), 1, Team(1));
  const double gradient[3][2] = {{-0.5, -0.5}, {0.5, 0}, {0, 0.5}};
  std::size_t i = 0;
  for (const auto& a : gradient)
    for (const auto& b : gradient)
      for (const double x : a)
        for (const double y : b) EXPECT_NEAR(space.sets[0].stiffness[i++], x * y, 1e-6);
}

TEST(Renumber, LeavesFixedNodesFixed) {
  CoarseSpace space =
      coarse_space(testing::make_problem(testing::grid(Filling::Quadrilaterals, {3, 3, 0}, 2)), 1, Team(1));
  const std::vector<std::int32_t> before = space.sets[0].nodes;
  renumber(space, {3, 1, 0, 2}, Team(1));
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_EQ(space.sets[0].nodes[i], before[i] < 0 ? -1 : (std::vector{3, 1, 0, 2}[std::size_t(before[i])]));
}

TEST(Transposed, SwapsRowsAndColumns) {
  // [1 0 2]      [1 0]
  // [0 3 0]  →   [0 3]
  //              [2 0]
  const SparseRows rows{{0, 2, 3}, {0, 2, 1}, {1, 2, 3}};
  const SparseRows columns = transposed(rows, 3);
  EXPECT_EQ(columns.begin, (std::vector<std::int64_t>{0, 1, 2, 3}));
  EXPECT_EQ(columns.column, (std::vector<std::int32_t>{0, 1, 0}));
  EXPECT_EQ(columns.factor, (std::vector<float>{1, 3, 2}));
  const SparseRows again = transposed(columns, 2);
  EXPECT_EQ(again.begin, rows.begin);
  EXPECT_EQ(again.column, rows.column);
  EXPECT_EQ(again.factor, rows.factor);
}

}  // namespace
}  // namespace varimesh
