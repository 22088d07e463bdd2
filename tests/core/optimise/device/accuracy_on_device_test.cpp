// Whole runs of the default objective on a device: as good as on the processor, with the same bits in every run, and
// whole after each fault. The device is the processor in a device's place, or a card that a library in the driver's
// place has.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "core/optimise/optimiser.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::read_case;
using OpenDevice = decltype(RunControl::open_device);

OpenDevice processor() {
  return []() -> device::Possible<std::unique_ptr<device::Device>> { return device::make_cpu_device(); };
}

Options options_on(DeviceChoice device) {
  Options options;
  options.device = device;
  options.threads = 1;
  return options;
}

Result run(const HighOrderMesh& mesh, const Options& options, OpenDevice open, const OnIteration& on_iteration = {},
           std::string_view checkpoint = {}) {
  RunControl control;
  control.open_device = std::move(open);
  control.checkpoint = checkpoint;
  auto result = optimise(mesh, options, on_iteration, control);
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}
Result on_device(const HighOrderMesh& mesh) { return run(mesh, options_on(DeviceChoice::Gpu), processor()); }
Result on_processor(const HighOrderMesh& mesh) { return run(mesh, options_on(DeviceChoice::Cpu), {}); }

double loss_of(const HighOrderMesh& mesh) { return local_loss(mesh, mesh.coordinates, Team(1)); }
std::int64_t rounds_on_device(const Result& result) {
  return std::ranges::count_if(result.history, [](const Iteration& iteration) {
    return iteration.phase == Phase::Accuracy && iteration.on_device;
  });
}
std::int64_t rounds(const Result& result) {
  return std::ranges::count(result.history, Phase::Accuracy, &Iteration::phase);
}

struct Case {
  const char* name;
  HighOrderMesh (*mesh)();
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

/// Its sides are curved, and its cells with them.
HighOrderMesh bent_mesh(Filling filling, int order) {
  HighOrderMesh mesh = testing::grid(filling, {3, 3, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* const x = &mesh.coordinates[3 * node];
    x[1] += 0.1 * std::sin(3 * x[0]);
  }
  testing::shake(mesh, 0.02 / (order * order), 7);
  return mesh;
}

/// Valid and invalid ones, in the plane and in space, of all kinds of shapes, with layers.
const Case kCases[] = {{"AerofoilTriangles4", [] { return read_case("aerofoil_disc_p4.msh"); }},
                       {"DiscTriangles4", [] { return read_case("disc_p4.msh"); }},
                       {"AnnulusTriangles3", [] { return read_case("annulus_p3.msh"); }},
                       {"SphereTetrahedra3Invalid", [] { return read_case("sphere_p3.msh"); }},
                       {"ThickLayer3", [] { return read_case("thick_layer_p3.msh"); }},
                       {"MixedPlane3", [] { return bent_mesh(Filling::MixedPlane, 3); }},
                       {"MixedSolid3", [] { return bent_mesh(Filling::MixedSolid, 3); }},
                       {"Hexahedra3", [] { return bent_mesh(Filling::Hexahedra, 3); }}};

class AccuracyOnADevice : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Cases, AccuracyOnADevice, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return std::string(info.param.name); });

TEST_P(AccuracyOnADevice, EndsWhereTheProcessorEnds) {
  const HighOrderMesh mesh = GetParam().mesh();
  const Result ours = on_device(mesh), theirs = on_processor(mesh);
  EXPECT_EQ(theirs.device, "");
  EXPECT_EQ(rounds_on_device(theirs), 0);
  EXPECT_EQ(ours.device, "the processor");
  EXPECT_GT(rounds(ours), 0);
  EXPECT_EQ(rounds_on_device(ours), rounds(ours));
  EXPECT_EQ(ours.notes, theirs.notes);
  EXPECT_EQ(ours.after.uncertified.size(), theirs.after.uncertified.size());
  EXPECT_NE(ours.mesh.coordinates, theirs.mesh.coordinates) << "the steps were made elsewhere";
  const double loss = loss_of(theirs.mesh);
  EXPECT_NEAR(loss_of(ours.mesh), loss, 0.01 * loss);
  EXPECT_NEAR(ours.after.min_scaled_jacobian, theirs.after.min_scaled_jacobian, 0.01);
  EXPECT_NEAR(ours.after.mean_scaled_jacobian, theirs.after.mean_scaled_jacobian, 1e-3);
}

TEST_P(AccuracyOnADevice, HasTheSameBitsInEveryRun) {
  const HighOrderMesh mesh = GetParam().mesh();
  Options options = options_on(DeviceChoice::Gpu);
  const Result one = run(mesh, options, processor());
  options.threads = 2;
  EXPECT_EQ(run(mesh, options, processor()).mesh.coordinates, one.mesh.coordinates);
}

// The rounds cost many cells their certificate. These go back and get more weight, on the processor.
TEST(AccuracyOnADeviceIn, KeepsTheCertificatesOfCellsThatLoseThem) {
  const HighOrderMesh mesh = read_case("small_ball_p3.msh");
  Options options = options_on(DeviceChoice::Gpu);
  options.max_iterations = 26;
  const Result ours = run(mesh, options, processor());
  options.device = DeviceChoice::Cpu;
  const Result theirs = run(mesh, options, {});
  EXPECT_GT(rounds(ours), 3);
  EXPECT_EQ(rounds_on_device(ours), rounds(ours));
  EXPECT_EQ(ours.after.uncertified.size(), theirs.after.uncertified.size());
  const double loss = loss_of(theirs.mesh);
  EXPECT_NEAR(loss_of(ours.mesh), loss, 0.1 * loss);
}

/// A run with the checkpoint of each of its rounds.
struct Kept {
  Result result;
  std::vector<std::string> checkpoints;
};
Kept keep_checkpoints(const HighOrderMesh& mesh, const Options& options, OpenDevice open) {
  Kept kept;
  RunControl control;
  control.open_device = std::move(open);
  control.checkpoint_due = [](const Iteration& iteration) { return iteration.phase == Phase::Accuracy; };
  control.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) {
    std::string& bytes = kept.checkpoints.emplace_back();
    write([&](std::string_view more) {
      bytes += more;
      return true;
    });
  };
  auto result = optimise(mesh, options, {}, control);
  EXPECT_TRUE(result);
  kept.result = std::move(*result);
  return kept;
}

TEST(AccuracyOnADeviceIn, GoesOnFromItsOwnCheckpointsToTheSameBytes) {
  const HighOrderMesh mesh = read_case("disc_p4.msh");
  const Options options = options_on(DeviceChoice::Gpu);
  const Kept whole = keep_checkpoints(mesh, options, processor());
  ASSERT_GT(whole.checkpoints.size(), 1U);
  for (const std::string& checkpoint : whole.checkpoints) {
    const Result again = run(mesh, options, processor(), {}, checkpoint);
    EXPECT_GT(again.resumed_from, 0);
    EXPECT_EQ(again.mesh.coordinates, whole.result.mesh.coordinates);
  }
}

TEST(AccuracyOnADeviceIn, GoesOnFromCheckpointsOfTheOther) {
  const HighOrderMesh mesh = read_case("disc_p4.msh");
  const Options there = options_on(DeviceChoice::Gpu), here = options_on(DeviceChoice::Cpu);
  const Kept device = keep_checkpoints(mesh, there, processor()), usual = keep_checkpoints(mesh, here, {});
  const double loss = loss_of(usual.result.mesh);
  ASSERT_FALSE(device.checkpoints.empty());
  ASSERT_FALSE(usual.checkpoints.empty());
  const Result from_device = run(mesh, here, {}, {}, device.checkpoints.front());
  EXPECT_GT(from_device.resumed_from, 0);
  EXPECT_EQ(from_device.device, "the processor") << "the device of the rounds before";
  EXPECT_EQ(rounds_on_device(from_device), from_device.resumed_from);
  EXPECT_NEAR(loss_of(from_device.mesh), loss, 0.01 * loss);
  const Result from_processor = run(mesh, there, processor(), {}, usual.checkpoints.front());
  EXPECT_GT(from_processor.resumed_from, 0);
  EXPECT_EQ(rounds_on_device(from_processor), rounds(from_processor) - from_processor.resumed_from);
  EXPECT_NEAR(loss_of(from_processor.mesh), loss, 0.01 * loss);
}

class AccuracyOnACard : public ::testing::Test {
 protected:
  void SetUp() override {
    if (device::descent_kernels(2).packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
  void TearDown() override { unsetenv("FAKE_CUDA"); }
  static OpenDevice card(const std::string& state) {
    return [state] { return testing::fake_card(state); };
  }
  const HighOrderMesh mesh_ = read_case("disc_p4.msh");
  const Options options_ = options_on(DeviceChoice::Gpu);
};

TEST_F(AccuracyOnACard, HasTheBitsOfTheProcessorInItsPlace) {
  const Result here = run(mesh_, options_, card(""));
  EXPECT_EQ(here.device, "Fake Card 1");
  EXPECT_EQ(here.mesh.coordinates, on_device(mesh_).mesh.coordinates);
}

TEST_F(AccuracyOnACard, EndsWholeWithASentenceIfTheCardCannotBegin) {
  const Result usual = on_processor(mesh_);
  const std::pair<const char*, const char*> faults[] = {{"memory=20000", "has no room for"},
                                                        {"memory=60000", "has no room for"},
                                                        {"load=218", "The driver did not accept the kernels"},
                                                        {"launch=701", "cannot run the kernel"},
                                                        {"lost=3", "failed when"}};
  for (const auto& [state, sentence] : faults) {
    SCOPED_TRACE(state);
    const Result result = run(mesh_, options_, card(state));
    EXPECT_EQ(result.mesh.coordinates, usual.mesh.coordinates) << "all of it was on the processor";
    EXPECT_EQ(result.device, "");
    EXPECT_EQ(rounds_on_device(result), 0);
    ASSERT_EQ(result.notes.size(), usual.notes.size() + 1);
    EXPECT_NE(result.notes.back().find("The run was on the processor. "), std::string::npos) << result.notes.back();
    EXPECT_NE(result.notes.back().find(sentence), std::string::npos) << result.notes.back();
  }
}

// A run that loses its card between two rounds ends as one that goes on from there on the processor.
TEST_F(AccuracyOnACard, GoesOnOnTheProcessorAfterTheRoundInWhichItWasLost) {
  const Kept whole = keep_checkpoints(mesh_, options_, card(""));
  ASSERT_GT(whole.checkpoints.size(), 1U);
  for (std::size_t round = 0; round < 2; ++round) {
    SCOPED_TRACE(round);
    const Result expected = run(mesh_, options_on(DeviceChoice::Cpu), {}, {}, whole.checkpoints[round]);
    const int last = expected.resumed_from;
    const Result lost = run(mesh_, options_, card(""), [&](const Iteration& iteration) {
      if (iteration.number == last) setenv("FAKE_CUDA", "lost=1", 1);
      return Control::Continue;
    });
    EXPECT_EQ(lost.device, "Fake Card 1");
    EXPECT_EQ(rounds_on_device(lost), last);
    EXPECT_EQ(lost.mesh.coordinates, expected.mesh.coordinates);
    ASSERT_FALSE(lost.notes.empty());
    EXPECT_EQ(lost.notes.back().find("The run went on on the processor after a part of its steps. The device Fake Card "
                                     "1 failed"),
              0U)
        << lost.notes.back();
  }
}

TEST_F(AccuracyOnACard, MakesAStepOnceMoreIfTheCardIsLostInIt) {
  const double loss = loss_of(on_processor(mesh_).mesh);
  int in_the_middle = 0;
  for (int launch = 50; launch < 20000; launch = launch * 3 / 2) {
    SCOPED_TRACE(launch);
    const Result result = run(mesh_, options_, card("lost_at_wait=" + std::to_string(launch)));
    EXPECT_TRUE(result.after.uncertified.empty());
    EXPECT_NEAR(loss_of(result.mesh), loss, 0.01 * loss);
    if (!result.device.empty() && rounds_on_device(result) < rounds(result)) ++in_the_middle;
  }
  EXPECT_GT(in_the_middle, 1);
}

TEST_F(AccuracyOnACard, TakesTheCardAgainForALaterDescentThatItHasRoomFor) {
  bool has_room = false;
  const Result result = run(mesh_, options_, card("memory=20000"), [&](const Iteration& iteration) {
    EXPECT_TRUE(has_room || !iteration.on_device);
    if (iteration.number == 1) {
      setenv("FAKE_CUDA", "", 1);  // another process gives its memory back
      has_room = true;
    }
    return Control::Continue;
  });
  EXPECT_EQ(result.device, "Fake Card 1");
  ASSERT_FALSE(result.notes.empty());
  EXPECT_NE(result.notes.back().find("A part of the run was on the processor. The device Fake Card 1 has no room"),
            std::string::npos)
      << result.notes.back();
  EXPECT_LT(rounds_on_device(result), rounds(result));
}

}  // namespace
}  // namespace varimesh
