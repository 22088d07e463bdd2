// Sixteen cells side by side: where their numbers are, and what fills the lanes past the last cell.
#include "core/kernels/hessian/batches.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <set>

#include "core/base/index.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class MakeBatches : public ::testing::TestWithParam<Filling> {
 protected:
  MakeBatches()
      : problem_(testing::make_problem(
            testing::grid(GetParam(), {3, 3, 2}, 2, testing::bent(testing::is_plane(GetParam()) ? 2 : 3)))),
        kernels_(make_hessian_kernels(material(Options{}), problem_.dimension)),
        batches_(make_batches(problem_, *kernels_)) {}

  /// Calls body(set, cell, batch, lane) for every lane; lanes past the last cell repeat it.
  template <class Body>
  void for_each_lane(const Body& body) const {
    for (const BatchSet& set : batches_)
      for (std::int32_t b = 0; b < set.count; ++b)
        for (int lane = 0; lane < kBatch; ++lane) body(set, std::min(b * kBatch + lane, set.cells->count - 1), b, lane);
  }

  Problem problem_;
  std::unique_ptr<HessianKernels> kernels_;
  std::vector<BatchSet> batches_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, MakeBatches, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(MakeBatches, HoldsEveryCellOfEverySet) {
  ASSERT_EQ(batches_.size(), problem_.sets.size());
  for (std::size_t s = 0; s < batches_.size(); ++s) {
    EXPECT_EQ(batches_[s].cells, &problem_.sets[s]);
    EXPECT_EQ(batches_[s].count, (problem_.sets[s].count + kBatch - 1) / kBatch);
    EXPECT_EQ(batches_[s].entries, kernels_->entries());
  }
}

TEST_P(MakeBatches, KnowsTheRankOfEveryNode) {
  const auto fixed = static_cast<std::int32_t>(problem_.free.size());
  for_each_lane([&](const BatchSet& set, std::int32_t cell, std::int32_t b, int lane) {
    const int nodes = set.cells->nodes_per_cell;
    for (int n = 0; n < nodes; ++n) {
      const std::int32_t node = set.cells->nodes[at(cell * nodes + n)];
      const auto found = std::ranges::find(problem_.free, node);
      EXPECT_EQ(set.ranks[at((b * nodes + n) * kBatch + lane)],
                found == problem_.free.end() ? fixed : static_cast<std::int32_t>(found - problem_.free.begin()));
    }
  });
}

TEST_P(MakeBatches, HasTheTargetsInTheGradientsDirections) {
  const int d = problem_.dimension;
  for_each_lane([&](const BatchSet& set, std::int32_t cell, std::int32_t b, int lane) {
    const CellSet& cells = *set.cells;
    const int per_cell = cells.affine ? 1 : cells.points;
    for (int slot = 0; slot < per_cell; ++slot) {
      // A_s⁻¹ = D⁻ᵀ A⁻¹ where the rows of D are the directions s.
      Eigen::MatrixXd inverse(d, d), found(d, d);
      const int point = cells.affine ? 0 : set.gradient.points[at(slot)];
      for (int i = 0; i < d * d; ++i) {
        inverse(i / d, i % d) = cells.inverse_target_of(cell)[cells.affine ? i : i * cells.stride + point];
        found(i / d, i % d) = set.inverse_target[at(((b * per_cell + slot) * d * d + i) * kBatch + lane)];
      }
      const Eigen::MatrixXd back = set.gradient.directions.transpose() * found;
      EXPECT_LT((back - inverse).norm(), 1e-5 * inverse.norm());
    }
  });
}

TEST_P(MakeBatches, MakesTheSameWithSeveralThreads) {
  for (const int threads : {2, 3, 8}) {
    const Team team(threads);
    team.run([&] {
      const std::vector<BatchSet> shared = make_batches(problem_, *kernels_, team);
      for (std::size_t s = 0; s < shared.size(); ++s) {
        EXPECT_EQ(shared[s].ranks, batches_[s].ranks);
        EXPECT_EQ(shared[s].inverse_target, batches_[s].inverse_target);
        EXPECT_EQ(shared[s].contributions.size(), batches_[s].contributions.size());
      }
    });
  }
}

TEST_P(MakeBatches, TakesNewTargets) {
  EXPECT_TRUE(batches_[0].left_factor.empty());
  const int d = problem_.dimension;
  const UntouchedVector<float> before = batches_[0].inverse_target;
  for (CellSet& set : problem_.sets) {
    for (double& number : set.inverse_target) number *= 2;
    set.left_factor.resize(at(set.count * d * d));
    for (std::size_t i = 0; i < set.left_factor.size(); ++i) set.left_factor[i] = double(i);
  }
  copy_targets(batches_);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_FLOAT_EQ(batches_[0].inverse_target[i], 2 * before[i]);
  for_each_lane([&](const BatchSet& set, std::int32_t cell, std::int32_t b, int lane) {
    for (int entry = 0; entry < d * d; ++entry)
      EXPECT_EQ(set.left_factor[at((b * d * d + entry) * kBatch + lane)], float(cell * d * d + entry));
  });
}

TEST_P(MakeBatches, HasRoomForThePartsOfEveryNode) {
  for (const BatchSet& set : batches_)
    for (const int width : {problem_.dimension, 2 * problem_.dimension}) {
      std::set<std::size_t> places;
      for (std::int32_t cell = 0; cell < set.cells->count; ++cell)
        for (int n = 0; n < set.cells->nodes_per_cell; ++n)
          for (int k = 0; k < width; ++k)
            EXPECT_TRUE(places.insert(set.contribution_index(cell, n, width) + at(k)).second)
                << "no place is used twice";
      EXPECT_LT(*places.rbegin(), set.contributions.size());
    }
}

TEST(PartIndex, PutsTheLanesOfANodeSideBySide) {
  // Batches of 16 cells with 5 nodes, 3 numbers wide.
  EXPECT_EQ(contribution_index(0, 0, 5, 3), 0U);
  EXPECT_EQ(contribution_index(1, 0, 5, 3), 3U);
  EXPECT_EQ(contribution_index(0, 1, 5, 3), 48U);
  EXPECT_EQ(contribution_index(16, 0, 5, 3), 240U);
  EXPECT_EQ(contribution_index(17, 2, 5, 3), 240U + 96U + 3U);
}

}  // namespace
}  // namespace varimesh
