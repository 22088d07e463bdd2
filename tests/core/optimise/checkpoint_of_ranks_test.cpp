// A run that several ranks share saves checkpoints from which any number of ranks goes on to the same bytes.
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/ranks/thread_ranks.h"
#include "tests/core/optimise/run_on_a_grid.h"

namespace varimesh {
namespace {

using testing::Filling;

using KeptCase = testing::RunOnAGrid;

class CheckpointOfRanks : public ::testing::TestWithParam<KeptCase> {
 protected:
  static Options options() { return GetParam().options(); }
  static HighOrderMesh mesh() { return GetParam().mesh(); }

  /// Runs it by so many ranks, and calls check(result) on each.
  template <class Check>
  static void run(int count, std::string_view checkpoint, const Check& check) {
    run_as_ranks(count, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      control.checkpoint = checkpoint;
      const auto result = optimise(mesh(), options(), {}, control);
      ASSERT_TRUE(result) << result.error().sentence;
      check(*result);
    });
  }

  /// The checkpoints of a run by so many ranks, by iteration.
  static std::map<int, std::string> kept_by(int count) {
    std::map<int, std::string> kept;
    run_as_ranks(count, [&](const Ranks& ranks) {
      RunControl control;
      control.ranks = &ranks;
      control.checkpoint_due = [](const Iteration&) { return true; };
      control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
        EXPECT_TRUE(ranks.is_first());
        EXPECT_TRUE(write([&](std::string_view bytes) {
          kept[iteration.number] += bytes;
          return true;
        }));
      };
      EXPECT_TRUE(optimise(mesh(), options(), {}, control));
    });
    return kept;
  }
};

INSTANTIATE_TEST_SUITE_P(
    Meshes, CheckpointOfRanks,
    ::testing::Values(KeptCase{"Newton", Filling::Triangles, {24, 24, 0}, 3, 0.0005, Objective::Energy},
                      KeptCase{"MixedSolid", Filling::MixedSolid, {6, 6, 6}, 2, 0.003, Objective::Energy},
                      KeptCase{"Untangling", Filling::Tetrahedra, {4, 4, 4}, 2, 0.3, Objective::Energy},
                      KeptCase{"Loss", Filling::Tetrahedra, {4, 4, 4}, 4, 0.0005, Objective::Accuracy},
                      KeptCase{"LossOfAMixedSolid", Filling::MixedSolid, {6, 6, 6}, 2, 0.003, Objective::Accuracy},
                      KeptCase{"LossAfterUntangling", Filling::Tetrahedra, {4, 4, 4}, 2, 0.3, Objective::Accuracy}),
    [](const auto& info) { return std::string(info.param.name); });

TEST_P(CheckpointOfRanks, LeadsAnyNumberOfRanksToTheSameBytes) {
  const auto whole = optimise(mesh(), options());
  ASSERT_TRUE(whole);
  const std::map<int, std::string> of_one = kept_by(1), of_three = kept_by(3);
  ASSERT_GE(of_three.size(), 2U);
  ASSERT_EQ(of_one.size(), of_three.size());
  int place = 0;
  for (const auto& [number, checkpoint] : of_three) {
    EXPECT_EQ(checkpoint.size(), of_one.at(number).size()) << "after iteration " << number;
    // The first, some on the way, and the last.
    const auto last = static_cast<int>(of_three.size()) - 1, step = std::max(1, last / 2);
    if (const int now = place++; now % step != 0 && now != last) continue;
    const auto goes_on = [&, number = number](const Result& result) {
      EXPECT_EQ(result.resumed_from, number);
      EXPECT_EQ(result.mesh.coordinates, whole->mesh.coordinates);
      EXPECT_EQ(result.stop_reason, whole->stop_reason);
      EXPECT_EQ(result.iterations, whole->iterations);
      EXPECT_EQ(result.history.size(), whole->history.size());
      EXPECT_EQ(result.notes, whole->notes);
    };
    SCOPED_TRACE("after iteration " + std::to_string(number));
    for (const int count : {1, 2, 5}) run(count, checkpoint, goes_on);
    run(3, of_one.at(number), goes_on);
  }
}

TEST_P(CheckpointOfRanks, IsIgnoredByAllIfItIsDamaged) {
  const auto whole = optimise(mesh(), options());
  std::string checkpoint = kept_by(2).begin()->second;
  checkpoint[checkpoint.size() / 2] ^= 1;
  run(3, checkpoint, [&](const Result& result) {
    EXPECT_EQ(result.resumed_from, 0);
    EXPECT_EQ(result.mesh.coordinates, whole->mesh.coordinates);
  });
}

/// A disk may be full, or the sink say no.
TEST_P(CheckpointOfRanks, IsSkippedIfTheFirstRankCannotSaveIt) {
  const auto whole = optimise(mesh(), options());
  run_as_ranks(3, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    control.checkpoint_due = [](const Iteration&) { return true; };
    control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
      if (iteration.number % 2 == 0) return;
      EXPECT_FALSE(write([](std::string_view) { return false; }));
      EXPECT_FALSE(write([](std::string_view) { return true; })) << "it works once";
    };
    const auto result = optimise(mesh(), options(), {}, control);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->mesh.coordinates, whole->mesh.coordinates);
  });
}

}  // namespace
}  // namespace varimesh
