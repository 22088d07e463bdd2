// What a team prepares for the solver is the same for every number of threads, and clusters are those of the plain way.
#include <gtest/gtest.h>

#include <deque>

#include "core/problem/clusters/clusters.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/problem/targets.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr int kThreads[] = {2, 3, 16};

bool operator==(const Incidence& a, const Incidence& b) {
  return a.cell == b.cell && a.set == b.set && a.local == b.local;
}

struct PlainNeighbours {
  explicit PlainNeighbours(const HighOrderMesh& mesh) : cells(mesh, mesh.dimension), at(mesh.node_count()) {
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (const std::int32_t v : vertices(cell))
        at[static_cast<std::size_t>(v)].push_back(static_cast<std::int32_t>(cell));
  }
  std::span<const std::int32_t> vertices(std::size_t cell) const {
    return cells.nodes(cell).first(static_cast<std::size_t>(reference::info(cells.shape(cell)).vertices));
  }

  Cells cells;
  std::vector<std::vector<std::int32_t>> at;
};

// The plain way: in each step, every cell without a region takes the lowest region of the cells around it.
std::vector<std::int32_t> plain_regions(const PlainNeighbours& near, std::int32_t size) {
  const auto cells = static_cast<std::int32_t>(near.cells.count()), seeds = std::max(1, (cells + size / 2) / size);
  std::vector<std::int32_t> region(near.cells.count(), -1);
  for (std::int32_t seed = 0; seed < seeds; ++seed)
    region[static_cast<std::size_t>((2 * seed + 1) * cells / (2 * seeds))] = seed;
  for (bool grows = seeds > 1; grows;) {
    std::vector<std::int32_t> next = region;
    for (std::size_t cell = 0; cell < region.size(); ++cell)
      for (const std::int32_t v : near.vertices(cell))
        for (const std::int32_t other : near.at[static_cast<std::size_t>(v)])
          if (const std::int32_t r = region[static_cast<std::size_t>(other)];
              region[cell] < 0 && r >= 0 && (next[cell] < 0 || r < next[cell]))
            next[cell] = r;
    grows = next != region;
    region = std::move(next);
  }
  std::int32_t left = 0;
  for (std::int32_t& r : region)
    if (r < 0) r = seeds > 1 ? seeds + left++ / size : 0;
  return region;
}

// The plain way: queues that hold a cell as often as a cluster has come by it.
Clusters plain_clusters(const HighOrderMesh& mesh, std::int32_t size) {
  const PlainNeighbours near(mesh);
  const std::vector<std::int32_t> region = plain_regions(near, std::max(64 * size, 4096));
  Clusters clusters;
  std::vector<bool> taken(region.size()), waits(region.size());
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
    for (const std::int32_t v : near.vertices(static_cast<std::size_t>(cell)))
      for (const std::int32_t other : near.at[static_cast<std::size_t>(v)]) {
        const auto number = static_cast<std::size_t>(other);
        if (taken[number] || region[number] != region[static_cast<std::size_t>(cell)]) continue;
        front.push_back(other);
        if (!waits[number]) waiting.push_back(other);
        waits[number] = true;
      }
  };
  for (std::int32_t r = 0; r <= (region.empty() ? -1 : std::ranges::max(region)); ++r, room = 0)
    for (std::size_t seed = 0; seed < region.size(); ++seed) {
      if (taken[seed] || region[seed] != r) continue;
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
  // Several tasks per loop, and several regions.
  HighOrderMesh mesh_ = testing::is_plane(GetParam()) ? testing::grid(GetParam(), {110, 90, 0}, 2, testing::bent(2))
                                                      : testing::grid(GetParam(), {16, 15, 14}, 2, testing::bent(3));
};

INSTANTIATE_TEST_SUITE_P(Fillings, SharedSetUp, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(SharedSetUp, GrowsTheClustersOfThePlainWay) {
  for (const std::int32_t size : {1, 7, 75, 100000}) {
    const Clusters plain = plain_clusters(mesh_, size);
    for (const int threads : {1, 2, 3, 16}) {
      const Team team(threads);
      Clusters clusters;
      team.run([&] { clusters = cluster_cells(mesh_, size, team); });
      EXPECT_EQ(clusters.cells, plain.cells) << size << ", " << threads << " threads";
      EXPECT_EQ(clusters.begin, plain.begin);
    }
  }
}

TEST(SharedSetUpOfSeparateMeshes, DividesCellsThatNoRegionReaches) {
  // A row of squares, and as many squares that touch nothing.
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {9000, 1, 0}, 1);
  for (int i = 0; i < 9000; ++i)
    testing::add_cell(mesh, Shape::Quadrilateral, [&](testing::Place p) {
      p[0] += 10 + 2 * i;
      return p;
    });
  const Clusters plain = plain_clusters(mesh, 50);
  for (const int threads : {1, 2, 3, 16}) {
    const Team team(threads);
    Clusters clusters;
    team.run([&] { clusters = cluster_cells(mesh, 50, team); });
    EXPECT_EQ(clusters.cells, plain.cells);
    EXPECT_EQ(clusters.begin, plain.begin);
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
