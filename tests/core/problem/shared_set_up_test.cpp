// What a team prepares for the solver is the same for every number of threads, and clusters are those of the plain way.
#include <gtest/gtest.h>

#include <deque>

#include "core/problem/clusters.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/problem/targets.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr int kThreads[] = {2, 3, 8};

bool operator==(const Incidence& a, const Incidence& b) {
  return a.cell == b.cell && a.set == b.set && a.local == b.local;
}

// The plain way: queues that hold a cell as often as a cluster has come by it.
Clusters plain_clusters(const HighOrderMesh& mesh, std::int32_t size) {
  const Cells cells(mesh, mesh.dimension);
  std::vector<std::vector<std::int32_t>> at(mesh.node_count());
  const auto vertices = [&](std::size_t cell) {
    return cells.nodes(cell).first(static_cast<std::size_t>(reference::info(cells.shape(cell)).vertices));
  };
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (const std::int32_t v : vertices(cell))
      at[static_cast<std::size_t>(v)].push_back(static_cast<std::int32_t>(cell));
  Clusters clusters;
  std::vector<bool> taken(cells.count()), waits(cells.count());
  std::deque<std::int32_t> front, waiting;
  std::int32_t room = 0;
  const auto take = [&](std::int32_t cell) {
    if (room == 0) {
      clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
      room = size;
      front.clear();
    }
    taken[static_cast<std::size_t>(cell)] = true;
    clusters.cells.push_back(cell);
    --room;
    for (const std::int32_t v : vertices(static_cast<std::size_t>(cell)))
      for (const std::int32_t other : at[static_cast<std::size_t>(v)]) {
        if (taken[static_cast<std::size_t>(other)]) continue;
        front.push_back(other);
        if (!waits[static_cast<std::size_t>(other)]) waiting.push_back(other);
        waits[static_cast<std::size_t>(other)] = true;
      }
  };
  for (std::size_t seed = 0; seed < cells.count(); ++seed) {
    if (taken[seed]) continue;
    take(static_cast<std::int32_t>(seed));
    while (!waiting.empty()) {
      std::deque<std::int32_t>& queue = room > 0 && !front.empty() ? front : waiting;
      const std::int32_t cell = queue.front();
      queue.pop_front();
      if (!taken[static_cast<std::size_t>(cell)]) take(cell);
    }
  }
  clusters.begin.push_back(static_cast<std::int32_t>(clusters.cells.size()));
  return clusters;
}

class SharedSetUp : public ::testing::TestWithParam<Filling> {
 protected:
  // Several tasks per loop.
  HighOrderMesh mesh_ = testing::is_plane(GetParam()) ? testing::grid(GetParam(), {60, 50, 0}, 3, testing::bent(2))
                                                      : testing::grid(GetParam(), {12, 11, 10}, 3, testing::bent(3));
};

INSTANTIATE_TEST_SUITE_P(Fillings, SharedSetUp, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(SharedSetUp, GrowsTheClustersOfThePlainWay) {
  for (const std::int32_t size : {1, 7, 75, 100000}) {
    const Clusters plain = plain_clusters(mesh_, size);
    for (const int threads : {1, 2, 3, 8}) {
      const Team team(threads);
      Clusters clusters;
      team.run([&] { clusters = cluster_cells(mesh_, size, team); });
      EXPECT_EQ(clusters.cells, plain.cells) << size << ", " << threads << " threads";
      EXPECT_EQ(clusters.begin, plain.begin);
    }
  }
}

TEST_P(SharedSetUp, BuildsTheSameProblem) {
  const std::vector<bool> fixed = fixed_nodes(mesh_);
  const Problem one = build_problem(mesh_, fixed, 0);
  // Free nodes are numbered as they first occur in the cells.
  std::vector<std::int32_t> order;
  std::vector<bool> seen = fixed;
  for (const CellSet& set : one.sets)
    for (const std::int32_t node : set.nodes) {
      if (!seen[static_cast<std::size_t>(node)]) order.push_back(node);
      seen[static_cast<std::size_t>(node)] = true;
    }
  EXPECT_EQ(one.free, order);
  for (const int threads : kThreads) {
    const Team team(threads);
    Problem several;
    team.run([&] { several = build_problem(mesh_, fixed, 0, team); });
    EXPECT_EQ(several.cluster, one.cluster);
    EXPECT_EQ(several.free, one.free);
    EXPECT_EQ(several.offsets, one.offsets);
    EXPECT_TRUE(std::ranges::equal(several.incidences, one.incidences,
                                   [](const Incidence& a, const Incidence& b) { return a == b; }));
    ASSERT_EQ(several.sets.size(), one.sets.size());
    for (std::size_t b = 0; b < one.sets.size(); ++b) {
      EXPECT_EQ(several.sets[b].mesh_cell, one.sets[b].mesh_cell);
      EXPECT_EQ(several.sets[b].nodes, one.sets[b].nodes);
    }
  }
}

TEST_P(SharedSetUp, ConvertsNodesAndSetsTargetsToTheSameBits) {
  const std::vector<bool> fixed = fixed_nodes(mesh_);
  struct Outcome {
    Problem problem;
    std::vector<double> coordinates;
    Frame frame;
  };
  const auto with = [&](int threads) {
    const Team team(threads);
    Outcome outcome;
    team.run([&] {
      outcome.frame = frame_of(mesh_, team);
      outcome.problem = build_problem(mesh_, fixed, 0, team);
      outcome.problem.positions = solver_positions(mesh_, outcome.frame, team);
      set_targets(outcome.problem, {}, outcome.frame.diagonal, {}, team);
      std::vector<double> moved = outcome.problem.positions;
      for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += 1e-3 * std::sin(static_cast<double>(i));
      std::vector<std::int32_t> cells(mesh_.element_count(mesh_.dimension));
      for (std::size_t c = 0; c < cells.size(); ++c) cells[c] = static_cast<std::int32_t>(c);
      outcome.coordinates = mesh_.coordinates;
      NodeConversion(mesh_, outcome.frame, outcome.problem.positions, team)
          .update(moved, cells, outcome.coordinates, team);
    });
    return outcome;
  };
  const Outcome one = with(1);
  for (const int threads : kThreads) {
    const Outcome several = with(threads);
    EXPECT_EQ(several.frame.diagonal, one.frame.diagonal);
    EXPECT_EQ(several.frame.centre, one.frame.centre);
    EXPECT_EQ(several.problem.positions, one.problem.positions);
    EXPECT_EQ(several.coordinates, one.coordinates);
    EXPECT_EQ(several.problem.cell_size, one.problem.cell_size);
    EXPECT_EQ(several.problem.inverse_size, one.problem.inverse_size);
    for (std::size_t b = 0; b < one.problem.sets.size(); ++b) {
      EXPECT_EQ(several.problem.sets[b].inverse_target, one.problem.sets[b].inverse_target);
      EXPECT_EQ(several.problem.sets[b].measure, one.problem.sets[b].measure);
      EXPECT_EQ(several.problem.sets[b].uniform_target, one.problem.sets[b].uniform_target);
    }
  }
}

}  // namespace
}  // namespace varimesh
