// Newton's method by several ranks: every number of every step, and every position, has the bits of one process.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "core/ranks/thread_ranks.h"
#include "core/solvers/newton/newton.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

struct RanksCase {
  const char* name;
  Filling filling;
  std::array<int, 3> counts;
  int order;
  double thin = 1;  ///< The height of the lowest layer of cells, relative to the others.
  double p_norm = 1;
};
void PrintTo(const RanksCase& one, std::ostream* out) { *out << one.name; }

/// What a few steps leave: what each said, the positions, and the cells' scans after the last.
struct Walk {
  std::vector<NewtonOutcome> outcomes;
  std::vector<double> positions;
  std::vector<CellScan> scans;
};

class NewtonOfRanks : public ::testing::TestWithParam<RanksCase> {
 protected:
  static constexpr int kSteps = 2;

  void SetUp() override {
    const RanksCase& one = GetParam();
    HighOrderMesh mesh = testing::grid(one.filling, one.counts, one.order, [&](testing::Place x) {
      const std::size_t up = testing::is_plane(one.filling) ? 1 : 2;
      const double layer = 1.0 / one.counts[up];
      x[up] = x[up] < layer ? one.thin * x[up] : x[up] - (1 - one.thin) * layer;
      return testing::bent(testing::is_plane(one.filling) ? 2 : 3)(x);
    });
    problem_ = testing::make_problem(mesh);
    // Away from the targets, by up to a twentieth of the spacing of the nodes.
    const int most = std::max({one.counts[0], one.counts[1], one.counts[2]});
    const double amount = 0.05 * one.thin / (most * one.order);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-amount, amount);
    const auto d = static_cast<std::size_t>(problem_.dimension);
    for (const std::int32_t node : problem_.free)
      for (std::size_t k = 0; k < d; ++k) problem_.positions[static_cast<std::size_t>(node) * d + k] += uniform(random);
    kernels_ = make_kernels(material_, problem_.dimension);
    hessian_ = make_hessian_kernels(material_, problem_.dimension);
    const Team team(1);
    ColouredNodes schedule;
    Sweeper sweeper(problem_, schedule, *kernels_, Regularisation::Element, norm(), -1.0, team);
    sweeper.rebuild();
    sweeper.scan();
    drop_deformation(problem_);
  }
  PNorm norm() const { return PNorm{GetParam().p_norm}; }

  static Walk walk(Problem& problem, Newton& newton, const Team& team) {
    Walk walk;
    team.run([&] {
      for (int step = 0; step < kSteps; ++step) walk.outcomes.push_back(newton.step());
    });
    walk.positions = problem.positions;
    walk.scans.assign(newton.scans().begin(), newton.scans().end());
    return walk;
  }

  Walk plain() const {
    Problem problem = problem_;
    const Team team(1);
    Newton newton(problem, *kernels_, *hessian_, norm(), 1e-9, team);
    return walk(problem, newton, team);
  }
  Walk of(const Ranks& ranks, int threads) const {
    Problem problem = problem_;
    const Team team(threads);
    Newton newton(problem, *kernels_, *hessian_, norm(), 1e-9, team, ranks);
    return walk(problem, newton, team);
  }

  const Material material_ = material(Options{});
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
};

INSTANTIATE_TEST_SUITE_P(Meshes, NewtonOfRanks,
                         ::testing::Values(RanksCase{"Triangles1", Filling::Triangles, {40, 40, 0}, 1},
                                           RanksCase{"Quadrilaterals3", Filling::Quadrilaterals, {40, 40, 0}, 3},
                                           RanksCase{"MixedPlane2", Filling::MixedPlane, {40, 40, 0}, 2},
                                           RanksCase{"Hexahedra2", Filling::Hexahedra, {11, 11, 11}, 2},
                                           RanksCase{"Prisms2", Filling::Prisms, {9, 9, 9}, 2},
                                           RanksCase{"Pyramids1", Filling::Pyramids, {6, 6, 6}, 1},
                                           RanksCase{"Tetrahedra3", Filling::Tetrahedra, {5, 5, 5}, 3},
                                           RanksCase{"Tetrahedra2Norm", Filling::Tetrahedra, {5, 5, 5}, 2, 1, 2.0},
                                           RanksCase{"MixedSolid2", Filling::MixedSolid, {7, 7, 7}, 2},
                                           RanksCase{"ThinTriangles4", Filling::Triangles, {20, 80, 0}, 4, 0.02}),
                         [](const auto& info) { return std::string(info.param.name); });

void expect_same(const NewtonOutcome& mine, const NewtonOutcome& plain, const std::string& where) {
  EXPECT_EQ(mine.before, plain.before) << where;
  EXPECT_EQ(mine.after, plain.after) << where;
  EXPECT_EQ(mine.residual, plain.residual) << where;
  EXPECT_EQ(mine.gradient_norm, plain.gradient_norm) << where;
  EXPECT_EQ(mine.damping, plain.damping) << where;
  EXPECT_EQ(mine.products, plain.products) << where;
  EXPECT_EQ(mine.converged, plain.converged) << where;
  EXPECT_EQ(mine.linear_solve, plain.linear_solve) << where;
}

TEST_P(NewtonOfRanks, HasTheBitsOfOneProcess) {
  const Walk alone = plain();
  EXPECT_GE(alone.outcomes.front().products, 2);
  EXPECT_LT(alone.outcomes.front().after, alone.outcomes.front().before);
  for (const int count : {1, 2, 3, 5, 8})
    run_as_ranks(count, [&](const Ranks& ranks) {
      const Walk mine = of(ranks, count == 2 ? 2 : 1);
      const std::string who = std::to_string(count) + " ranks, rank " + std::to_string(ranks.rank());
      for (int step = 0; step < kSteps; ++step)
        expect_same(mine.outcomes[static_cast<std::size_t>(step)], alone.outcomes[static_cast<std::size_t>(step)],
                    who + ", step " + std::to_string(step));
      ASSERT_EQ(mine.positions.size(), alone.positions.size());
      EXPECT_EQ(std::memcmp(mine.positions.data(), alone.positions.data(), 8 * mine.positions.size()), 0) << who;
      ASSERT_EQ(mine.scans.size(), alone.scans.size());
      EXPECT_EQ(std::memcmp(mine.scans.data(), alone.scans.data(), sizeof(CellScan) * mine.scans.size()), 0) << who;
    });
}

TEST_P(NewtonOfRanks, StopsTogetherWhereTheNodesWere) {
  std::atomic<int> asked = 0;
  run_as_ranks(3, [&](const Ranks& ranks) {
    Problem problem = problem_;
    Team team(1);
    // The last rank wishes to stop after it was asked a few times.
    StopToken stop([&] { return ranks.rank() == 2 && ++asked > 4; });
    stop_together(stop, ranks);
    team.set_stop(&stop);
    Newton newton(problem, *kernels_, *hessian_, norm(), 1e-9, team, ranks);
    team.run([&] { EXPECT_THROW(newton.step(), Interrupted); });
    EXPECT_EQ(problem.positions, problem_.positions);
  });
}

}  // namespace
}  // namespace varimesh
