// A run with --repair split goes on from each of its checkpoints to the same result, though it is a sequence of runs.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "core/optimise/optimiser.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"

namespace varimesh {
namespace {

Options options_of_test() {
  Options options = testing::for_energy();
  options.repair = Repair::Split;
  options.threads = 1;
  options.max_iterations = 300;
  return options;
}

/// By iteration.
using Checkpoints = std::map<int, std::string>;

/// A run, and what it has told its caller.
struct Told {
  Result result;
  Checkpoints checkpoints;
  std::vector<int> iterations;
};

Told run(const HighOrderMesh& mesh, const Options& options, const std::string& from = "") {
  Told told;
  RunControl control;
  control.checkpoint = from;
  control.checkpoint_due = [](const Iteration&) { return true; };
  control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
    std::string& bytes = told.checkpoints[iteration.number];
    EXPECT_TRUE(write([&](std::string_view part) {
      bytes += part;
      return true;
    }));
  };
  const OnIteration note = [&](const Iteration& iteration) {
    told.iterations.push_back(iteration.number);
    return Control::Continue;
  };
  auto result = optimise(mesh, options, note, control);
  EXPECT_TRUE(result) << result.error().sentence;
  told.result = std::move(*result);
  return told;
}

void expect_same_history(const Result& one, const Result& other) {
  ASSERT_EQ(one.history.size(), other.history.size());
  for (std::size_t i = 0; i < one.history.size(); ++i) {
    const Iteration &a = one.history[i], &b = other.history[i];
    EXPECT_EQ(a.phase, b.phase);
    EXPECT_EQ(a.number, b.number);
    EXPECT_EQ(a.energy, b.energy);
    EXPECT_EQ(a.residual, b.residual);
    EXPECT_EQ(a.relative_gradient, b.relative_gradient);
    EXPECT_EQ(a.min_scaled_jacobian, b.min_scaled_jacobian);
    EXPECT_EQ(a.invalid_elements, b.invalid_elements);
    EXPECT_EQ(a.repairable_elements, b.repairable_elements);
    EXPECT_EQ(a.left_elements, b.left_elements);
    EXPECT_EQ(a.active_nodes, b.active_nodes);
    EXPECT_EQ(a.products, b.products);
    EXPECT_EQ(a.linear_solve, b.linear_solve);
    EXPECT_EQ(a.groups_left, b.groups_left);
    if (i > 0) {
      EXPECT_GE(a.seconds, one.history[i - 1].seconds);
    }
  }
}

void expect_same_report(const QualityReport& one, const QualityReport& other) {
  EXPECT_EQ(one.min_scaled_jacobian, other.min_scaled_jacobian);
  EXPECT_EQ(one.mean_scaled_jacobian, other.mean_scaled_jacobian);
  EXPECT_EQ(one.min_distortion_jacobian, other.min_distortion_jacobian);
  EXPECT_EQ(one.invalid_elements, other.invalid_elements);
  EXPECT_EQ(one.histogram, other.histogram);
  EXPECT_EQ(one.lattice_intervals, other.lattice_intervals);
  EXPECT_EQ(one.certified.valid, other.certified.valid);
  EXPECT_EQ(one.certified.invalid, other.certified.invalid);
  EXPECT_EQ(one.certified.undecided, other.certified.undecided);
  EXPECT_EQ(one.certified.min_scaled_jacobian_lower_bound, other.certified.min_scaled_jacobian_lower_bound);
  EXPECT_EQ(one.clockwise, other.clockwise);
  ASSERT_EQ(one.invalid.size(), other.invalid.size());
  for (std::size_t i = 0; i < one.invalid.size(); ++i) {
    EXPECT_EQ(one.invalid[i].number, other.invalid[i].number);
    EXPECT_EQ(one.invalid[i].scaled_jacobian, other.invalid[i].scaled_jacobian);
    EXPECT_EQ(one.invalid[i].place, other.invalid[i].place);
  }
  ASSERT_EQ(one.uncertified.size(), other.uncertified.size());
  for (std::size_t i = 0; i < one.uncertified.size(); ++i) {
    EXPECT_EQ(one.uncertified[i].number, other.uncertified[i].number);
    EXPECT_EQ(one.uncertified[i].answer, other.uncertified[i].answer);
    EXPECT_EQ(one.uncertified[i].place, other.uncertified[i].place);
  }
  ASSERT_EQ(one.accuracy.has_value(), other.accuracy.has_value());
  if (!one.accuracy) return;
  EXPECT_EQ(one.accuracy->loss, other.accuracy->loss);
  EXPECT_EQ(one.accuracy->modal_parts, other.accuracy->modal_parts);
}

void expect_same_findings(const Result& one, const Result& other) {
  ASSERT_EQ(one.unrepairable.size(), other.unrepairable.size());
  for (std::size_t i = 0; i < one.unrepairable.size(); ++i) {
    const UnrepairableGroup &a = one.unrepairable[i], &b = other.unrepairable[i];
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.vertex, b.vertex);
    EXPECT_EQ(a.elements, b.elements);
    EXPECT_EQ(a.cells, b.cells);
    EXPECT_EQ(a.place, b.place);
    EXPECT_EQ(a.determinant, b.determinant);
    EXPECT_EQ(a.sentence, b.sentence);
  }
  ASSERT_EQ(one.repairs.size(), other.repairs.size());
  for (std::size_t i = 0; i < one.repairs.size(); ++i) {
    EXPECT_EQ(one.repairs[i].kind, other.repairs[i].kind);
    EXPECT_EQ(one.repairs[i].vertices, other.repairs[i].vertices);
    EXPECT_EQ(one.repairs[i].node, other.repairs[i].node);
    EXPECT_EQ(one.repairs[i].elements, other.repairs[i].elements);
    EXPECT_EQ(one.repairs[i].new_elements, other.repairs[i].new_elements);
    EXPECT_EQ(one.repairs[i].sentence, other.repairs[i].sentence);
  }
}

void expect_same(const Result& one, const Result& other) {
  EXPECT_EQ(one.mesh.coordinates, other.mesh.coordinates);
  EXPECT_EQ(one.mesh.node_numbers, other.mesh.node_numbers);
  ASSERT_EQ(one.mesh.blocks.size(), other.mesh.blocks.size());
  for (std::size_t b = 0; b < one.mesh.blocks.size(); ++b)
    EXPECT_EQ(one.mesh.blocks[b].nodes, other.mesh.blocks[b].nodes);
  ASSERT_EQ(one.mesh.node_blocks.size(), other.mesh.node_blocks.size());
  for (std::size_t b = 0; b < one.mesh.node_blocks.size(); ++b)
    EXPECT_EQ(one.mesh.node_blocks[b].parameters, other.mesh.node_blocks[b].parameters);
  EXPECT_EQ(one.sizes.elements, other.sizes.elements);
  EXPECT_EQ(one.sizes.free_nodes, other.sizes.free_nodes);
  EXPECT_EQ(one.iterations, other.iterations);
  EXPECT_EQ(one.residual, other.residual);
  EXPECT_EQ(one.converged, other.converged);
  EXPECT_EQ(one.stopped, other.stopped);
  EXPECT_EQ(one.stop_reason, other.stop_reason);
  EXPECT_EQ(one.substitute_targets.elements, other.substitute_targets.elements);
  EXPECT_EQ(one.substitute_targets.sentence, other.substitute_targets.sentence);
  EXPECT_EQ(one.notes, other.notes);
  EXPECT_EQ(one.left.sentence, other.left.sentence);
  EXPECT_EQ(one.kept_as_it_came, other.kept_as_it_came);
  expect_same_report(one.before, other.before);
  expect_same_report(one.after, other.after);
  expect_same_findings(one, other);
  expect_same_history(one, other);
}

struct Case {
  std::string name;
  HighOrderMesh (*mesh)();
  int stride = 1;  ///< Every checkpoint of that number is resumed from.
  Objective objective = Objective::Energy;
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

class ResumedSplitting : public ::testing::TestWithParam<Case> {};

TEST_P(ResumedSplitting, GoesOnFromEveryCheckpointToTheSameResult) {
  const HighOrderMesh mesh = GetParam().mesh();
  Options options = options_of_test();
  options.objective = GetParam().objective;
  const auto undisturbed = optimise(mesh, options);
  ASSERT_TRUE(undisturbed);
  const Told watched = run(mesh, options);
  expect_same(watched.result, *undisturbed);
  ASSERT_FALSE(watched.checkpoints.empty());
  int place = 0;
  for (const auto& [number, checkpoint] : watched.checkpoints) {
    if (place++ % GetParam().stride != 0) continue;
    SCOPED_TRACE("after iteration " + std::to_string(number));
    options.threads = number % 2 == 0 ? 3 : 1;
    const Told resumed = run(mesh, options, checkpoint);
    EXPECT_EQ(resumed.result.resumed_from, number);
    expect_same(resumed.result, *undisturbed);
    ASSERT_EQ(resumed.iterations.size(), std::size_t(undisturbed->iterations - number)) << "no run is done again";
    // A run that goes on twice is the same too.
    for (const auto& [later, bytes] : resumed.checkpoints) EXPECT_TRUE(watched.checkpoints.contains(later));
    if (resumed.checkpoints.empty() || place % 4 != 1) continue;
    expect_same(run(mesh, options, resumed.checkpoints.rbegin()->second).result, *undisturbed);
    if (HasFailure()) break;
  }
}

// The first two become valid by splits. The third is left unsplit. The last becomes valid before any split.
INSTANTIATE_TEST_SUITE_P(
    Cases, ResumedSplitting,
    ::testing::Values(Case{"Six", [] { return testing::six_in_a_ball(3); }, 3},
                      Case{"Two", [] { return testing::two_in_a_ball(3); }, 2},
                      Case{"TwoOfOrderFour", [] { return testing::two_in_a_ball(4); }, 11},
                      Case{"Accuracy", [] { return testing::six_in_a_ball(3); }, 7, Objective::Accuracy},
                      Case{"Worst", [] { return testing::six_in_a_ball(3); }, 11, Objective::Worst},
                      Case{"Sphere", [] { return testing::read_case("sphere_p3.msh"); }, 3}),
    [](const auto& info) { return info.param.name; });

/// A run of 44 iterations, eleven of them before the first split, and its checkpoint after iteration 30.
class CheckpointAmidRounds : public ::testing::Test {
 protected:
  static constexpr int kNumber = 30, kBeforeTheSplit = 11;

  void SetUp() override {
    ASSERT_EQ(whole_.result.history[kBeforeTheSplit - 1].groups_left, -1);
    ASSERT_GE(whole_.result.history[kBeforeTheSplit].groups_left, 0);
    ASSERT_TRUE(whole_.checkpoints.contains(kNumber));
    checkpoint_ = whole_.checkpoints.at(kNumber);
    std::uint64_t size = 0;
    std::memcpy(&size, checkpoint_.data(), sizeof size);
    under_way_ = sizeof size + size;
    ASSERT_LT(under_way_, checkpoint_.size());
  }

  const HighOrderMesh mesh_ = testing::two_in_a_ball(3);
  const Options options_ = options_of_test();
  const Told whole_ = run(mesh_, options_);
  std::string checkpoint_;
  std::size_t under_way_ = 0;  ///< Where the checkpoint of the run under way begins in it.
};

TEST_F(CheckpointAmidRounds, IsPassedOverIfWhatWasFinishedIsDamaged) {
  for (std::size_t at = 0; at < under_way_; at += 1 + under_way_ / 7) {
    std::string damaged = checkpoint_;
    damaged[at] = static_cast<char>(damaged[at] ^ 16);
    const Told resumed = run(mesh_, options_, damaged);
    EXPECT_EQ(resumed.result.resumed_from, 0) << "byte " << at;
    expect_same(resumed.result, whole_.result);
  }
  const Told other = run(testing::six_in_a_ball(3), options_, checkpoint_);
  EXPECT_EQ(other.result.resumed_from, 0);
  EXPECT_EQ(run(mesh_, options_, checkpoint_.substr(0, 5)).result.resumed_from, 0);
}

TEST_F(CheckpointAmidRounds, BeginsTheRunUnderWayAgainIfOnlyThatIsDamaged) {
  std::string damaged = checkpoint_;
  damaged[(under_way_ + checkpoint_.size()) / 2] ^= 16;
  for (const std::string& bytes :
       {damaged, checkpoint_.substr(0, under_way_), checkpoint_.substr(0, under_way_ + 50)}) {
    const Told resumed = run(mesh_, options_, bytes);
    EXPECT_EQ(resumed.result.resumed_from, kBeforeTheSplit);
    EXPECT_EQ(resumed.iterations.front(), kBeforeTheSplit + 1);
    expect_same(resumed.result, whole_.result);
  }
}

TEST_F(CheckpointAmidRounds, CountsTheTimeAndTheIterationsBeforeIt) {
  Options options = options_;
  options.time_limit = 1e-9;
  const Told late = run(mesh_, options, checkpoint_);
  EXPECT_EQ(late.result.resumed_from, kNumber);
  EXPECT_EQ(late.result.iterations, kNumber) << "it has the state of the checkpoint before it is stopped";
  EXPECT_EQ(late.result.stop_reason, StopReason::TimeLimit);
  EXPECT_GE(late.result.seconds, whole_.result.history[kNumber - 1].seconds);
  options = options_;
  options.max_iterations = kNumber + 2;
  const Told few = run(mesh_, options, checkpoint_);
  EXPECT_EQ(few.result.iterations, kNumber + 2);
  EXPECT_EQ(few.result.stop_reason, StopReason::Iterations);
}

}  // namespace
}  // namespace varimesh
