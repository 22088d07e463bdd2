// A run that is interrupted anywhere continues from its checkpoint to the same bytes; a checkpoint that is damaged or
// belongs to something else is ignored.
#include "core/solvers/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::read_case;

/// A grid with one in three of the boundary's nodes out of place. Some cells are left for untangling, and some cannot
/// be repaired.
HighOrderMesh dented(Filling filling, int order, double push) {
  HighOrderMesh mesh = testing::grid(filling, {3, 3, 2}, order);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  std::vector<bool> vertex(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks) {
    const auto vertices = std::size_t(reference::info(block.shape).vertices);
    const auto nodes = std::size_t(reference::node_count(block.shape, block.order));
    for (std::size_t i = 0; i < block.nodes.size(); ++i)
      if (i % nodes < vertices) vertex[std::size_t(block.nodes[i])] = true;
  }
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> far(-push, push);
  for (std::size_t n = 0, places = 0; n < mesh.node_count(); ++n)
    if (fixed[n] && !vertex[n] && ++places % 3 == 0)
      for (std::size_t k = 0; k < std::size_t(mesh.dimension); ++k) mesh.coordinates[3 * n + k] += far(random);
  return mesh;
}

std::string written(const WriteCheckpoint& write) {
  std::string bytes;
  EXPECT_TRUE(write([&](std::string_view part) {
    bytes += part;
    return true;
  }));
  return bytes;
}

struct Case {
  std::string name;
  HighOrderMesh (*mesh)();
  Options options;
  std::set<Phase> phases;  ///< The phases that it goes through.
  int stride = 1;          ///< Every checkpoint of that number is resumed from.
};

Options with(const std::function<void(Options&)>& change) {
  Options options = testing::for_energy();
  options.threads = 1;
  change(options);
  return options;
}

void expect_same(const Result& one, const Result& other) {
  EXPECT_EQ(one.mesh.coordinates, other.mesh.coordinates);
  EXPECT_EQ(one.stop_reason, other.stop_reason);
  EXPECT_EQ(one.converged, other.converged);
  EXPECT_EQ(one.iterations, other.iterations);
  EXPECT_EQ(one.after.certified.valid, other.after.certified.valid);
  ASSERT_EQ(one.history.size(), other.history.size());
  for (std::size_t i = 0; i < one.history.size(); ++i) {
    EXPECT_EQ(one.history[i].phase, other.history[i].phase);
    EXPECT_EQ(one.history[i].number, other.history[i].number);
    EXPECT_EQ(one.history[i].energy, other.history[i].energy);
    EXPECT_EQ(one.history[i].residual, other.history[i].residual);
    EXPECT_EQ(one.history[i].relative_gradient, other.history[i].relative_gradient);
    EXPECT_EQ(one.history[i].active_nodes, other.history[i].active_nodes);
    EXPECT_EQ(one.history[i].products, other.history[i].products);
    EXPECT_EQ(one.history[i].invalid_elements, other.history[i].invalid_elements);
  }
}

const std::set<Phase> kSweeps{Phase::Sweeps}, kNewton{Phase::Newton}, kBoth{Phase::Sweeps, Phase::Newton},
    kAll{Phase::Sweeps, Phase::Newton, Phase::Untangle};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

class ResumedRun : public ::testing::TestWithParam<Case> {};

TEST_P(ResumedRun, GoesOnFromEveryCheckpointToTheSameBytes) {
  const auto undisturbed = optimise(GetParam().mesh(), GetParam().options);
  ASSERT_TRUE(undisturbed) << undisturbed.error().sentence;
  std::map<int, std::string> kept;
  RunControl keeping;
  keeping.checkpoint_due = [](const Iteration&) { return true; };
  keeping.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
    kept[iteration.number] = written(write);
  };
  const auto watched = optimise(GetParam().mesh(), GetParam().options, {}, keeping);
  ASSERT_TRUE(watched);
  expect_same(*watched, *undisturbed);

  std::set<Phase> phases;
  int place = 0;
  for (const auto& [number, checkpoint] : kept) {
    phases.insert(watched->history[std::size_t(number) - 1].phase);
    if (place++ % GetParam().stride != 0) continue;
    SCOPED_TRACE("after iteration " + std::to_string(number));
    RunControl control;
    control.checkpoint = checkpoint;
    Options options = GetParam().options;
    options.threads = number % 2 == 0 ? 3 : 1;
    const auto resumed = optimise(GetParam().mesh(), options, {}, control);
    ASSERT_TRUE(resumed);
    EXPECT_EQ(resumed->resumed_from, number);
    expect_same(*resumed, *undisturbed);
    if (HasFailure()) break;
  }
  EXPECT_EQ(phases, GetParam().phases);
}

INSTANTIATE_TEST_SUITE_P(
    Cases, ResumedRun,
    ::testing::Values(
        Case{"NineTriangles", [] { return read_case("nine_triangles.msh"); },
             with([](Options& o) { o.constants = Constants::Reference; }), kBoth},
        Case{"SweepsInTheAnnulus", [] { return read_case("annulus_p3.msh"); },
             with([](Options& o) { o.method = Method::Sweeps; }), kSweeps, 3},
        Case{"SweepsOverAllNodes", [] { return read_case("cylinder_p2.msh"); },
             with([](Options& o) { o.method = Method::Sweeps, o.active_set = false, o.max_iterations = 60; }), kSweeps},
        Case{"SweepsByPatches", [] { return read_case("cylinder_p2.msh"); },
             with([](Options& o) { o.method = Method::Sweeps, o.regularisation = Regularisation::Patch; }), kSweeps, 2},
        Case{"NewtonWithAPNorm", [] { return read_case("cylinder_p2.msh"); },
             with([](Options& o) { o.p_norm = 3, o.max_iterations = 40; }), kNewton},
        Case{"Annulus", [] { return read_case("annulus_p3.msh"); }, with([](Options&) {}), kNewton},
        Case{"Sphere", [] { return read_case("sphere_p3.msh"); }, with([](Options&) {}), kNewton},
        Case{"Aerofoil", [] { return read_case("aerofoil_p4.msh"); }, with([](Options&) {}), kNewton},
        Case{"Circle", [] { return read_case("circle_p5.msh"); }, with([](Options& o) { o.energy = Energy::Winslow; }),
             kNewton},
        Case{"BestOfAll", [] { return dented(Filling::MixedSolid, 2, 0.04); },
             with([](Options& o) { o.until_js = 0.9, o.max_iterations = 40; }), kNewton},
        Case{"WorstOfAll", [] { return read_case("circle_p5.msh"); },
             with([](Options& o) { o.objective = Objective::Worst; }), kNewton, 5},
        Case{"Untangling", [] { return dented(Filling::Triangles, 3, 0.1); }, with([](Options&) {}), kAll, 6},
        Case{"UntanglingASolid", [] { return dented(Filling::Tetrahedra, 2, 0.1); }, with([](Options&) {}), kAll, 40}),
    [](const auto& info) { return info.param.name; });

// === Bytes ===============================================================================================

enum class Word : std::uint8_t { First, Second };

/// Numbers of every kind, archived as a class with state does it.
struct Numbers {
  std::int32_t number = 0;
  double real = 0;
  bool truth = false;
  Word word = Word::First;
  std::vector<double> many;
  std::vector<std::int64_t> none;

  template <class Archive>
  void state(Archive& archive) {
    archive(number, real, truth, word, many, none);
  }
};

Numbers some_numbers() {
  Numbers numbers{-7, 0.1, true, Word::Second, {}, {}};
  for (int i = 0; i < 100000; ++i) numbers.many.push_back(1.0 / (i + 1));  // more than one piece
  return numbers;
}

std::string checkpoint_of(Numbers numbers, std::uint64_t fingerprint) {
  std::string bytes;
  CheckpointWriter writer(
      [&](std::string_view part) {
        bytes += part;
        return true;
      },
      fingerprint);
  numbers.state(writer);
  EXPECT_TRUE(writer.finish());
  return bytes;
}

TEST(CheckpointReader, ReadsWhatWasWritten) {
  const Numbers written = some_numbers();
  const std::string bytes = checkpoint_of(written, 42);
  Numbers read;
  read.none = {1, 2};
  CheckpointReader reader(bytes, 42);
  read.state(reader);
  EXPECT_FALSE(reader.failed());
  EXPECT_EQ(read.number, written.number);
  EXPECT_EQ(read.real, written.real);
  EXPECT_EQ(read.truth, written.truth);
  EXPECT_EQ(read.word, written.word);
  EXPECT_EQ(read.many, written.many);
  EXPECT_TRUE(read.none.empty());
}

TEST(CheckpointReader, FailsOnAnotherFingerprintAndOnEveryChangedByte) {
  const std::string bytes = checkpoint_of({1, 2, true, Word::Second, {3, 4}, {5}}, 42);
  EXPECT_FALSE(CheckpointReader(bytes, 42).failed());
  EXPECT_TRUE(CheckpointReader(bytes, 43).failed());
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    EXPECT_TRUE(CheckpointReader(damaged, 42).failed()) << "byte " << at;
    EXPECT_TRUE(CheckpointReader(bytes.substr(0, at), 42).failed()) << "cut at byte " << at;
  }
}

TEST(CheckpointReader, FailsBehindTheEndAndGivesZeros) {
  const std::string bytes = checkpoint_of({1, 2, true, Word::Second, {3, 4}, {5}}, 42);
  CheckpointReader reader(bytes, 42);
  Numbers numbers;
  numbers.state(reader);
  ASSERT_FALSE(reader.failed());
  double more = 7;
  std::vector<double> many{7};
  reader(more, many);
  EXPECT_TRUE(reader.failed());
  EXPECT_EQ(more, 0);
  EXPECT_TRUE(many.empty());
}

TEST(CheckpointWriter, SaysIfItsSinkStopped) {
  int pieces = 0;
  CheckpointWriter writer([&](std::string_view) { return ++pieces < 2; }, 42);
  some_numbers().state(writer);
  EXPECT_FALSE(writer.finish());
  EXPECT_EQ(pieces, 2) << "it is not asked again";
}

TEST(Fingerprint, DependsOnEveryByteAndOnTheirOrder) {
  const auto print = [](std::initializer_list<std::string_view> parts) {
    Fingerprint fingerprint;
    for (const std::string_view part : parts) fingerprint.add(part);
    return fingerprint.value();
  };
  EXPECT_EQ(print({"twelve bytes"}), print({"twelve bytes"}));
  EXPECT_NE(print({"twelve bytes"}), print({"twelve byteS"}));
  EXPECT_NE(print({"a", "b"}), print({"b", "a"}));
  EXPECT_NE(print({"ab"}), print({"a", "b"}));
  EXPECT_NE(print({""}), print({std::string_view("\0", 1)}));
}

TEST(FingerprintOfARun, LeavesOutOnlyWhatSaysWhenToStop) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 2);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const auto print = [&](const std::function<void(Options&)>& change) {
    return fingerprint(mesh, fixed, {}, with(change));
  };
  const std::uint64_t plain = print([](Options&) {});
  EXPECT_EQ(print([](Options& o) { o.max_iterations = 3, o.time_limit = 5, o.threads = 7; }), plain);
  EXPECT_NE(print([](Options& o) { o.tolerance = 1e-4; }), plain);
  EXPECT_NE(print([](Options& o) { o.energy = Energy::Winslow; }), plain);
  EXPECT_NE(print([](Options& o) { o.p_norm = 2; }), plain);
  EXPECT_NE(print([](Options& o) { o.until_js = 0.1; }), plain);
  std::vector<bool> more = fixed;
  more[std::size_t(std::ranges::find(more, false) - more.begin())] = true;
  EXPECT_NE(fingerprint(mesh, more, {}, with([](Options&) {})), plain);
}

// === Unusable checkpoints ================================================================================

/// A checkpoint of a short run, with its mesh and options.
class UnusableCheckpoint : public ::testing::Test {
 protected:
  void SetUp() override {
    RunControl keeping;
    keeping.checkpoint_due = [](const Iteration&) { return true; };
    keeping.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) { kept_ = written(write); };
    undisturbed_ = *optimise(mesh_, options_, {}, keeping);
    ASSERT_FALSE(kept_.empty());
  }

  void expect_passed_over(const std::string& checkpoint, const HighOrderMesh& mesh, const Options& options) {
    RunControl control;
    control.checkpoint = checkpoint;
    const auto result = optimise(mesh, options, {}, control);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->resumed_from, 0);
    expect_same(*result, *optimise(mesh, options));
  }

  HighOrderMesh mesh_ = read_case("nine_triangles.msh");
  Options options_ = testing::for_energy();
  Result undisturbed_;
  std::string kept_;
};

TEST_F(UnusableCheckpoint, OfAnotherMeshIsPassedOver) {
  HighOrderMesh other = mesh_;
  testing::move_nodes(other, [](testing::Place p) { return testing::Place{p[0] * 1.0001, p[1], p[2]}; });
  expect_passed_over(kept_, other, options_);
}

TEST_F(UnusableCheckpoint, OfOtherOptionsIsPassedOver) {
  Options other = options_;
  other.energy = Energy::Distortion;
  expect_passed_over(kept_, mesh_, other);
}

TEST_F(UnusableCheckpoint, CutOffOrDamagedIsPassedOver) {
  for (const std::size_t size : {std::size_t{0} + 1, std::size_t{30}, kept_.size() / 2, kept_.size() - 1})
    expect_passed_over(kept_.substr(0, size), mesh_, options_);
  for (std::size_t at = 0; at < kept_.size(); at += 1 + kept_.size() / 60) {
    std::string damaged = kept_;
    damaged[at] = static_cast<char>(damaged[at] ^ 16);
    expect_passed_over(damaged, mesh_, options_);
  }
}

TEST_F(UnusableCheckpoint, OfAShorterRunIsNone) {
  Options longer = options_;
  longer.max_iterations = 2000;
  longer.threads = 2;
  RunControl control;
  control.checkpoint = kept_;
  const auto result = optimise(mesh_, longer, {}, control);
  EXPECT_GT(result->resumed_from, 0);
  expect_same(*result, undisturbed_);
}

TEST(RunControl, ChangesThreadsBetweenIterations) {
  Options options = testing::for_energy();
  options.threads = 1;
  const auto alone = optimise(read_case("sphere_p3.msh"), options);
  int asked = 0;
  RunControl control;
  control.threads = [&] { return 1 + asked++ % 4; };
  const auto lent = optimise(read_case("sphere_p3.msh"), options, {}, control);
  EXPECT_GT(asked, alone->iterations);
  expect_same(*lent, *alone);
}

}  // namespace
}  // namespace varimesh
