// The order of a sweep: every free node once, and no two groups of one colour at one cell.
#include "core/solvers/sweeps/colouring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <ostream>
#include <set>
#include <string>
#include <tuple>

#include "core/reference/nodes.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {

void PrintTo(Colouring colouring, std::ostream* out) { *out << (colouring == Colouring::Node ? "Node" : "Group"); }

namespace {

using testing::Filling;

Problem problem_of(const HighOrderMesh& mesh) { return build_problem(mesh, fixed_nodes(mesh), 0); }

/// The cells of one group's nodes.
std::set<std::int32_t> cells_of(const Problem& problem, const ColouredNodes& schedule, std::int32_t group) {
  std::set<std::int32_t> cells;
  for (std::int32_t n = schedule.groups[std::size_t(group)]; n < schedule.groups[std::size_t(group) + 1]; ++n) {
    const auto rank = std::size_t(schedule.nodes[std::size_t(n)]);
    for (std::int64_t i = problem.offsets[rank]; i < problem.offsets[rank + 1]; ++i) {
      const Incidence& at = problem.incidences[std::size_t(i)];
      cells.insert(problem.sets[std::size_t(at.set)].first + at.cell);
    }
  }
  return cells;
}

class ScheduleOf : public ::testing::TestWithParam<std::tuple<Filling, Colouring>> {
 protected:
  HighOrderMesh mesh_ = testing::grid(std::get<0>(GetParam()), {5, 4, 3}, 3);
  Problem problem_ = problem_of(mesh_);
  ColouredNodes schedule_ = colour_nodes(problem_, std::get<1>(GetParam()));
};

INSTANTIATE_TEST_SUITE_P(Fillings, ScheduleOf,
                         ::testing::Combine(::testing::ValuesIn(testing::kFillings),
                                            ::testing::Values(Colouring::Node, Colouring::Group)),
                         [](const auto& info) {
                           return testing::name(std::get<0>(info.param)) +
                                  ("By" + ::testing::PrintToString(std::get<1>(info.param)));
                         });

TEST_P(ScheduleOf, VisitsEveryFreeNodeOnce) {
  std::vector<std::int32_t> visited = schedule_.nodes, every(problem_.free.size());
  std::ranges::sort(visited);
  std::iota(every.begin(), every.end(), 0);
  EXPECT_EQ(visited, every);
}

TEST_P(ScheduleOf, DividesNodesIntoGroupsAndGroupsIntoColours) {
  ASSERT_EQ(schedule_.groups.front(), 0);
  EXPECT_EQ(std::size_t(schedule_.groups.back()), schedule_.nodes.size());
  ASSERT_EQ(schedule_.colours.front(), 0);
  EXPECT_EQ(std::size_t(schedule_.colours.back()), schedule_.group_count());
  for (std::size_t g = 0; g < schedule_.group_count(); ++g) EXPECT_LT(schedule_.groups[g], schedule_.groups[g + 1]);
  for (std::size_t c = 0; c < schedule_.colour_count(); ++c) EXPECT_LT(schedule_.colours[c], schedule_.colours[c + 1]);
}

TEST_P(ScheduleOf, GivesGroupsThatShareACellDifferentColours) {
  for (std::size_t colour = 0; colour < schedule_.colour_count(); ++colour) {
    std::set<std::int32_t> taken;
    for (std::int32_t group = schedule_.colours[colour]; group < schedule_.colours[colour + 1]; ++group)
      for (const std::int32_t cell : cells_of(problem_, schedule_, group))
        EXPECT_TRUE(taken.insert(cell).second) << "colour " << colour << " has cell " << cell << " twice";
  }
}

TEST_P(ScheduleOf, GivesEachGroupTheFirstColourThatItsNeighboursLeave) {
  // Each group meets one of every earlier colour: it could not have come sooner.
  std::vector<std::set<std::int32_t>> taken(schedule_.colour_count());
  for (std::size_t colour = 0; colour < schedule_.colour_count(); ++colour)
    for (std::int32_t group = schedule_.colours[colour]; group < schedule_.colours[colour + 1]; ++group) {
      const std::set<std::int32_t> cells = cells_of(problem_, schedule_, group);
      for (std::size_t earlier = 0; earlier < colour; ++earlier)
        EXPECT_TRUE(std::ranges::any_of(cells, [&](std::int32_t cell) { return taken[earlier].contains(cell); }));
      taken[colour].insert(cells.begin(), cells.end());
    }
}

TEST_P(ScheduleOf, DoesNotDependOnCoordinates) {
  HighOrderMesh moved = mesh_;
  testing::move_nodes(moved, testing::bent(mesh_.dimension, 0.3));
  for (double& x : moved.coordinates) x *= 1000;
  const ColouredNodes other = colour_nodes(problem_of(moved), std::get<1>(GetParam()));
  EXPECT_EQ(other.nodes, schedule_.nodes);
  EXPECT_EQ(other.groups, schedule_.groups);
  EXPECT_EQ(other.colours, schedule_.colours);
}

TEST_P(ScheduleOf, DoesNotDependOnTheNumberOfThreads) {
  for (const int threads : {2, 3, 8}) {
    const Team team(threads);
    ColouredNodes shared;
    team.run([&] { shared = colour_nodes(problem_, std::get<1>(GetParam()), team); });
    EXPECT_EQ(shared.nodes, schedule_.nodes);
    EXPECT_EQ(shared.groups, schedule_.groups);
    EXPECT_EQ(shared.colours, schedule_.colours);
  }
}

TEST_P(ScheduleOf, VisitsTheNodesOfAGroupPlaceByPlace) {
  if (std::get<1>(GetParam()) == Colouring::Node) return;
  // The nodes of one place are visited together, and places in the order in which they first occur in the cells.
  for (std::size_t group = 0; group < schedule_.group_count(); ++group) {
    std::tuple<int, int, int, int> last{-1, 0, 0, 0};
    for (std::int32_t n = schedule_.groups[group]; n < schedule_.groups[group + 1]; ++n) {
      const auto rank = std::size_t(schedule_.nodes[std::size_t(n)]);
      const Incidence& at = problem_.incidences[std::size_t(problem_.offsets[rank])];
      const CellSet& set = problem_.sets[std::size_t(at.set)];
      const reference::NodePlace place = reference::node_places(set.shape, set.order)[std::size_t(at.local)];
      const std::tuple<int, int, int, int> here{at.set, at.cell, place.dimension, place.index};
      EXPECT_LE(last, here);
      last = here;
    }
  }
}

TEST(ScheduleByNode, HasOneNodeInEachGroup) {
  const Problem problem = problem_of(testing::grid(Filling::Triangles, {4, 4, 0}, 3));
  const ColouredNodes schedule = colour_nodes(problem, Colouring::Node);
  EXPECT_EQ(schedule.group_count(), problem.free.size());
  // An inner vertex of this grid has six triangles with 37 nodes in all.
  EXPECT_LE(schedule.colour_count(), 37U);
  EXPECT_GE(schedule.colour_count(), 10U) << "the ten nodes of one triangle all differ";
}

TEST(ScheduleByNode, GivesTheNodesOfOneCellAColourEach) {
  // The four inner nodes of one quadrilateral of order 3 share their cell.
  const HighOrderMesh mesh = testing::one_cell(Shape::Quadrilateral, 3, [](testing::Place p) { return p; });
  const ColouredNodes schedule = colour_nodes(problem_of(mesh), Colouring::Node);
  EXPECT_EQ(schedule.nodes, (std::vector<std::int32_t>{0, 1, 2, 3}));
  EXPECT_EQ(schedule.colours, (std::vector<std::int32_t>{0, 1, 2, 3, 4}));
}

TEST(ScheduleByGroup, NeedsFewerColours) {
  const Problem problem = problem_of(testing::grid(Filling::Tetrahedra, {4, 4, 4}, 3));
  EXPECT_LT(colour_nodes(problem, Colouring::Group).colour_count(),
            colour_nodes(problem, Colouring::Node).colour_count() / 2);
}

TEST(ScheduleByGroup, PutsTheNodesOfACluster) {
  // A group holds nodes of the lowest cluster that their cells are in.
  const Problem problem = problem_of(testing::grid(Filling::Hexahedra, {6, 6, 6}, 2));
  const ColouredNodes schedule = colour_nodes(problem, Colouring::Group);
  for (std::size_t group = 0; group < schedule.group_count(); ++group) {
    std::set<std::int32_t> clusters;
    for (std::int32_t n = schedule.groups[group]; n < schedule.groups[group + 1]; ++n) {
      const auto rank = std::size_t(schedule.nodes[std::size_t(n)]);
      std::int32_t lowest = problem.clusters;
      for (std::int64_t i = problem.offsets[rank]; i < problem.offsets[rank + 1]; ++i) {
        const Incidence& at = problem.incidences[std::size_t(i)];
        lowest = std::min(lowest, problem.cluster[std::size_t(problem.sets[std::size_t(at.set)].first + at.cell)]);
      }
      clusters.insert(lowest);
    }
    EXPECT_EQ(clusters.size(), 1U);
  }
}

TEST(ColouredNodes, OfNoFreeNodesIsEmpty) {
  const HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {2, 2, 0}, 2);
  const Problem problem = build_problem(mesh, std::vector<bool>(mesh.node_count(), true), 0);
  for (const Colouring colouring : {Colouring::Node, Colouring::Group}) {
    const ColouredNodes schedule = colour_nodes(problem, colouring);
    EXPECT_EQ(schedule.colour_count(), 0U);
    EXPECT_EQ(schedule.group_count(), 0U);
  }
}

}  // namespace
}  // namespace varimesh
