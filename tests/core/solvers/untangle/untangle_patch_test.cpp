// One patch: its free nodes move until every coefficient is positive, and nothing else does.
#include "core/solvers/untangle/untangle_patch.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <optional>
#include <random>

#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A whole mesh as one patch, whose free nodes have been moved at random.
class WholeMeshAsPatch : public ::testing::TestWithParam<Filling> {
 protected:
  void prepare(double push) {
    problem_ = testing::make_problem(testing::grid(GetParam(), {2, 2, 2}, 2));
    const int d = problem_.dimension;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> far(-push, push);
    for (const std::int32_t node : problem_.free)
      for (int k = 0; k < d; ++k) problem_.positions[std::size_t(node * d + k)] += far(random);
    for (const CellSet& set : problem_.sets) energies_.emplace_back(set);
    std::map<std::int32_t, std::int32_t> number;
    for (std::size_t f = 0; f < problem_.free.size(); ++f) number[problem_.free[f]] = std::int32_t(f);
    std::vector<UntanglePatch::Member> members;
    for (std::size_t s = 0; s < problem_.sets.size(); ++s)
      for (std::int32_t cell = 0; cell < problem_.sets[s].count; ++cell) {
        const CellSet& set = problem_.sets[s];
        UntanglePatch::Member& member = members.emplace_back();
        member.set = std::int16_t(s);
        member.cell.number = cell;
        member.cell.positions.resize(set.nodes_per_cell, d);
        for (int n = 0; n < set.nodes_per_cell; ++n) {
          const std::int32_t node = set.nodes[std::size_t(cell * set.nodes_per_cell + n)];
          for (int k = 0; k < d; ++k) member.cell.positions(n, k) = problem_.positions[std::size_t(node * d + k)];
          if (const auto found = number.find(node); found != number.end()) {
            member.cell.free.push_back(n);
            member.unknown.push_back(found->second);
          }
        }
      }
    patch_.emplace(energies_, std::move(members), problem_.free, d);
  }

  Problem problem_;
  std::vector<CoefficientEnergy> energies_;
  std::optional<UntanglePatch> patch_;
  Team team_{1};
  HessianRoom room_{std::int64_t{1} << 40};
};

INSTANTIATE_TEST_SUITE_P(Fillings, WholeMeshAsPatch, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(WholeMeshAsPatch, BeginsWithTheSmallestCoefficientOfItsCells) {
  prepare(0.15);
  double least = std::numeric_limits<double>::infinity();
  int bad = 0;
  for (const UntanglePatch::Member& member : patch_->members()) {
    const double smallest = energies_[std::size_t(member.set)].smallest_coefficient(member.cell);
    least = std::min(least, smallest);
    bad += smallest > 0 ? 0 : 1;
  }
  EXPECT_EQ(patch_->smallest_coefficient(), least);
  EXPECT_EQ(patch_->bad_cells(), bad);
  EXPECT_GT(bad, 0);
}

TEST_P(WholeMeshAsPatch, MakesEveryCoefficientPositive) {
  prepare(0.15);
  ASSERT_LT(patch_->smallest_coefficient(), 0);
  int steps = 0;
  while (patch_->bad_cells() > 0 && steps < 50) {
    const UntangleStep step = patch_->step(team_, room_);
    EXPECT_GT(step.gradient_norm, 0);
    EXPECT_GT(step.residual, 0);
    ++steps;
  }
  EXPECT_LT(steps, 50);
  EXPECT_GT(patch_->smallest_coefficient(), 0);
}

TEST_P(WholeMeshAsPatch, GathersItsPositionsFromTheProblem) {
  prepare(0.1);
  for (std::size_t n = 0; n < patch_->nodes().size(); ++n)
    for (int k = 0; k < problem_.dimension; ++k)
      EXPECT_EQ(patch_->positions()[Eigen::Index(n) * problem_.dimension + k],
                problem_.positions[std::size_t(patch_->nodes()[n] * problem_.dimension + k)]);
}

TEST_P(WholeMeshAsPatch, DoesNotDependOnTheRoomForHessians) {
  Eigen::VectorXd unlimited;
  for (const std::int64_t bytes : {std::int64_t{1} << 40, std::int64_t{100'000}, std::int64_t{0}}) {
    energies_.clear();
    prepare(0.15);
    HessianRoom room(bytes);
    for (int i = 0; i < 3; ++i) patch_->step(team_, room);
    EXPECT_EQ(room.left(), bytes) << "everything is given back";
    if (bytes > 100'000) unlimited = patch_->positions();
    EXPECT_EQ(patch_->positions(), unlimited);
  }
}

TEST_P(WholeMeshAsPatch, KnowsTheBytesOfItsHessians) {
  prepare(0.15);
  std::int64_t most = 0;
  for (const UntanglePatch::Member& member : patch_->members()) {
    const auto unknowns = std::int64_t(member.unknown.size()) * problem_.dimension;
    most += std::int64_t{sizeof(double)} * unknowns * unknowns;
  }
  EXPECT_EQ(patch_->hessian_bytes(), most);
}

TEST(HessianRoom, BorrowsWhatItLacksAndGivesItBack) {
  std::int64_t free = 150, asked = 0;
  const SpareMemory spare{[&](std::int64_t bytes) {
                            asked = bytes;
                            const std::int64_t lent = std::min(bytes, free);
                            free -= lent;
                            return lent;
                          },
                          [&](std::int64_t bytes) { free += bytes; }};
  {
    HessianRoom room(100, spare);
    room.grow_to(100);
    EXPECT_EQ(free, 150) << "it has enough";
    room.grow_to(180);
    EXPECT_EQ(room.left(), 180);
    room.grow_to(170);
    EXPECT_EQ(room.left(), 180) << "it keeps what it has";
    room.grow_to(300);
    EXPECT_EQ(asked, 120);
    EXPECT_EQ(room.left(), 250) << "no more was free";
    EXPECT_EQ(free, 0);
  }
  EXPECT_EQ(free, 150);
  free = std::int64_t{1} << 62;
  HessianRoom room(100, spare);
  room.grow_to(std::int64_t{1} << 61);
  EXPECT_EQ(room.left(), 100 + kMostSpareMemory);
  HessianRoom alone(100);
  alone.grow_to(200);
  EXPECT_EQ(alone.left(), 100) << "nobody lends";
}

TEST(HessianRoom, IsNeverOverdrawn) {
  HessianRoom room(100);
  EXPECT_TRUE(room.take(60));
  EXPECT_FALSE(room.take(60));
  EXPECT_TRUE(room.take(40));
  room.give_back(60);
  EXPECT_TRUE(room.take(60));
  EXPECT_EQ(room.left(), 0);
}

TEST_P(WholeMeshAsPatch, DoesNotDependOnTheNumberOfThreads) {
  Eigen::VectorXd alone;
  for (const int threads : {1, 3}) {
    energies_.clear();
    prepare(0.15);
    const Team team(threads);
    team.run([&] {
      for (int i = 0; i < 3; ++i) patch_->step(team, room_);
    });
    if (threads == 1) alone = patch_->positions();
  }
  EXPECT_EQ(patch_->positions(), alone);
}

}  // namespace
}  // namespace varimesh
