// A run that several ranks make together has the result of a run alone.
#include <gtest/gtest.h>

#include <cstring>
#include <ostream>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/ranks/thread_ranks.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

struct SharedCase {
  const char* name;
  Filling filling;
  std::array<int, 3> counts;
  int order;
  double shake;  ///< .3 turns cells over
  Objective objective = Objective::Energy;
  bool has_two_parts = true;  ///< It has enough cells for two ranks.
};
void PrintTo(const SharedCase& one, std::ostream* out) { *out << one.name; }

class RunOfRanks : public ::testing::TestWithParam<SharedCase> {
 protected:
  static Options options() {
    Options options;
    options.objective = GetParam().objective;
    options.threads = 1;
    return options;
  }
  static HighOrderMesh mesh() {
    const SharedCase& one = GetParam();
    HighOrderMesh mesh =
        testing::grid(one.filling, one.counts, one.order, testing::bent(testing::is_plane(one.filling) ? 2 : 3));
    testing::shake(mesh, one.shake, 7);
    return mesh;
  }
};

SharedCase accurate(const char* name, Filling filling, std::array<int, 3> counts, int order, double shake = 0.003,
                    bool has_two_parts = true) {
  return {name, filling, counts, order, shake, Objective::Accuracy, has_two_parts};
}

INSTANTIATE_TEST_SUITE_P(Meshes, RunOfRanks,
                         ::testing::Values(SharedCase{"Triangles", Filling::Triangles, {24, 24, 0}, 3, 0.0005},
                                           SharedCase{"MixedSolid", Filling::MixedSolid, {6, 6, 6}, 2, 0.003},
                                           SharedCase{"Tangled", Filling::Tetrahedra, {5, 5, 5}, 2, 0.3},
                                           accurate("LossTriangles4", Filling::Triangles, {20, 20, 0}, 4, 0.0003),
                                           accurate("LossQuadrilaterals3", Filling::Quadrilaterals, {24, 24, 0}, 3,
                                                    0.0005),
                                           accurate("LossMixedPlane2", Filling::MixedPlane, {21, 30, 0}, 2),
                                           accurate("LossHexahedra2", Filling::Hexahedra, {10, 10, 10}, 2),
                                           accurate("LossPrisms3", Filling::Prisms, {7, 7, 7}, 3),
                                           accurate("LossPyramids2", Filling::Pyramids, {5, 5, 5}, 2),
                                           accurate("LossTetrahedra4", Filling::Tetrahedra, {4, 4, 4}, 4, 0.0005),
                                           accurate("LossMixedSolid2", Filling::MixedSolid, {6, 6, 6}, 2),
                                           accurate("LossOfFewCells", Filling::MixedSolid, {2, 1, 1}, 3, 0.003, false),
                                           accurate("LossTangled", Filling::Tetrahedra, {4, 4, 4}, 2, 0.3)),
                         [](const auto& info) { return std::string(info.param.name); });

TEST_P(RunOfRanks, HasTheResultOfARunAlone) {
  const auto alone = optimise(mesh(), options());
  ASSERT_TRUE(alone) << alone.error().sentence;
  EXPECT_EQ(alone->before.uncertified.empty(), GetParam().shake < 0.1);
  ASSERT_GT(alone->history.size(), 1U);
  for (const int count : GetParam().shake < 0.1 ? std::vector{1, 2, 3, 5} : std::vector{1, 3})
    run_as_ranks(count, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      const Traffic before = ranks.traffic();
      const auto together = optimise(mesh(), options(), {}, control);
      ASSERT_TRUE(together) << together.error().sentence;
      EXPECT_EQ(ranks.traffic().meetings > before.meetings, count > 1);
      if (count == 2 && GetParam().has_two_parts) {
        EXPECT_GT(ranks.traffic().messages, before.messages) << "each has a part, and exchanges its halo";
      }
      const std::vector<double>&mine = together->mesh.coordinates, &all = alone->mesh.coordinates;
      ASSERT_EQ(mine.size(), all.size());
      EXPECT_EQ(std::memcmp(mine.data(), all.data(), 8 * all.size()), 0);
      ASSERT_EQ(together->history.size(), alone->history.size());
      for (std::size_t i = 0; i < alone->history.size(); ++i) {
        EXPECT_EQ(together->history[i].energy, alone->history[i].energy);
        EXPECT_EQ(together->history[i].residual, alone->history[i].residual);
        EXPECT_EQ(together->history[i].products, alone->history[i].products);
        EXPECT_EQ(together->history[i].min_scaled_jacobian, alone->history[i].min_scaled_jacobian);
        EXPECT_EQ(together->history[i].phase, alone->history[i].phase);
      }
      EXPECT_EQ(together->stop_reason, alone->stop_reason);
      EXPECT_EQ(together->after.min_scaled_jacobian, alone->after.min_scaled_jacobian);
      EXPECT_EQ(together->after.mean_scaled_jacobian, alone->after.mean_scaled_jacobian);
      ASSERT_TRUE(together->after.accuracy && alone->after.accuracy);
      EXPECT_EQ(together->after.accuracy->loss, alone->after.accuracy->loss);
      EXPECT_EQ(together->notes, alone->notes);
    });
}

TEST_P(RunOfRanks, TakesNoTimeLimit) {
  run_as_ranks(2, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    Options limited = options();
    limited.time_limit = 100;
    const auto refused = optimise(mesh(), limited, {}, control);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, Error::Kind::BadOption);
  });
}

}  // namespace
}  // namespace varimesh
