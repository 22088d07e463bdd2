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
};
void PrintTo(const SharedCase& one, std::ostream* out) { *out << one.name; }

class RunOfRanks : public ::testing::TestWithParam<SharedCase> {
 protected:
  static Options options() {
    Options options;
    options.objective = Objective::Energy;
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

INSTANTIATE_TEST_SUITE_P(Meshes, RunOfRanks,
                         ::testing::Values(SharedCase{"Triangles", Filling::Triangles, {24, 24, 0}, 3, 0.0005},
                                           SharedCase{"MixedSolid", Filling::MixedSolid, {6, 6, 6}, 2, 0.003},
                                           SharedCase{"Tangled", Filling::Tetrahedra, {5, 5, 5}, 2, 0.3}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST_P(RunOfRanks, HasTheResultOfARunAlone) {
  const auto alone = optimise(mesh(), options());
  ASSERT_TRUE(alone) << alone.error().sentence;
  EXPECT_EQ(alone->before.uncertified.empty(), GetParam().shake < 0.1);
  ASSERT_GT(alone->history.size(), 1U);
  for (const int count : {1, 3})
    run_as_ranks(count, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      const Traffic before = ranks.traffic();
      const auto together = optimise(mesh(), options(), {}, control);
      ASSERT_TRUE(together) << together.error().sentence;
      EXPECT_EQ(ranks.traffic().messages > before.messages, count > 1);
      const std::vector<double>&mine = together->mesh.coordinates, &all = alone->mesh.coordinates;
      ASSERT_EQ(mine.size(), all.size());
      EXPECT_EQ(std::memcmp(mine.data(), all.data(), 8 * all.size()), 0);
      ASSERT_EQ(together->history.size(), alone->history.size());
      for (std::size_t i = 0; i < alone->history.size(); ++i) {
        EXPECT_EQ(together->history[i].energy, alone->history[i].energy);
        EXPECT_EQ(together->history[i].residual, alone->history[i].residual);
        EXPECT_EQ(together->history[i].products, alone->history[i].products);
      }
      EXPECT_EQ(together->stop_reason, alone->stop_reason);
      EXPECT_EQ(together->after.min_scaled_jacobian, alone->after.min_scaled_jacobian);
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
