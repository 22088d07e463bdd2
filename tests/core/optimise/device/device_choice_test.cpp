// Runs on a device: when one is taken, what the result says of it, and that nothing changes without one.
#include "core/optimise/device/device_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "core/optimise/optimiser.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using device::Fault;
using testing::Filling;

HighOrderMesh bent_mesh(double shake) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {4, 3, 2}, 3, testing::bent(3));
  testing::shake(mesh, shake, 7);
  return mesh;
}

Options energy_on(DeviceChoice device) {
  Options options;
  options.objective = Objective::Energy;
  options.device = device;
  options.threads = 1;
  return options;
}

/// Opens the processor in a device's place, and counts how often.
struct Opener {
  int opened = 0;
  OpenDevice open() {
    return [this]() -> device::Possible<std::unique_ptr<device::Device>> {
      ++opened;
      return device::make_cpu_device();
    };
  }
};

Result run(const HighOrderMesh& mesh, const Options& options, OpenDevice open) {
  RunControl control;
  control.open_device = std::move(open);
  auto result = optimise(mesh, options, {}, control);
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}

/// By how much the energy has fallen after the first step. At the end it is nearly 0, and most of that is rounding.
double fallen(const Result& result) { return result.history.front().energy - result.history.back().energy; }

OpenDevice no_driver() {
  return [] { return device::fault(Fault::Kind::NoDriver, "There is no driver."); };
}

TEST(DeviceOfARun, IsWhereItsNewtonStepsAreMade) {
  using Case = std::pair<double, Objective>;
  for (const auto& [shake, objective] :
       {Case(0.01, Objective::Energy), Case(0.08, Objective::Energy), Case(0.08, Objective::Worst)}) {
    const HighOrderMesh mesh = bent_mesh(shake);
    Options options = energy_on(DeviceChoice::Gpu);
    options.objective = objective;
    Opener opener;
    const Result ours = run(mesh, options, opener.open());
    options.device = DeviceChoice::Cpu;
    const Result theirs = run(mesh, options, {});
    EXPECT_EQ(opener.opened, 1) << "one device for all stages and attempts";
    EXPECT_EQ(ours.device, "the processor");
    EXPECT_EQ(theirs.device, "");
    EXPECT_EQ(ours.notes, theirs.notes);
    EXPECT_EQ(ours.converged, theirs.converged);
    EXPECT_EQ(ours.after.uncertified.size(), theirs.after.uncertified.size());
    EXPECT_NE(ours.mesh.coordinates, theirs.mesh.coordinates) << "the steps were made elsewhere";
    EXPECT_NEAR(ours.after.min_scaled_jacobian, theirs.after.min_scaled_jacobian,
                objective == Objective::Energy ? 1e-3 : 2e-2);
    if (objective == Objective::Energy) {
      EXPECT_NEAR(ours.history.back().energy, theirs.history.back().energy, 1e-10 * fallen(theirs));
      EXPECT_NEAR(ours.iterations, theirs.iterations, 1);
    }
  }
}

TEST(DeviceOfARun, IsNotOpenedUnlessTheOptionsAskForIt) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  Opener opener;
  run(mesh, energy_on(DeviceChoice::Cpu), opener.open());
  const Result small = run(mesh, energy_on(DeviceChoice::Auto), opener.open());
  EXPECT_EQ(opener.opened, 0) << "the mesh is too small for auto";
  EXPECT_EQ(small.device, "");
  EXPECT_TRUE(small.notes.empty());
  Options options = energy_on(DeviceChoice::Auto);
  const auto has_device = [&](std::int64_t elements) {
    return DeviceOfRun(options, elements, opener.open()).get().get() != nullptr;
  };
  EXPECT_TRUE(has_device(kLeastElementsOnDevice));
  EXPECT_FALSE(has_device(kLeastElementsOnDevice - 1));
  options.objective = Objective::Accuracy;
  EXPECT_TRUE(has_device(kLeastElementsOnDevice));
  options.method = Method::Sweeps;
  EXPECT_FALSE(has_device(kLeastElementsOnDevice));
  EXPECT_EQ(opener.opened, 2);
}

TEST(DeviceOfARun, LeavesEveryByteAsItIsIfThereIsNone) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  const Result usual = run(mesh, energy_on(DeviceChoice::Cpu), {});
  const Result none = run(mesh, energy_on(DeviceChoice::Gpu), no_driver());
  EXPECT_EQ(none.mesh.coordinates, usual.mesh.coordinates);
  EXPECT_EQ(none.device, "");
  EXPECT_EQ(none.notes, std::vector<std::string>{"The run was on the processor. There is no driver."});
  RunSummary automatic;
  DeviceOfRun(energy_on(DeviceChoice::Auto), kLeastElementsOnDevice, no_driver())
      .tell(automatic.device, automatic.notes);
  EXPECT_TRUE(automatic.notes.empty()) << "auto takes what there is";
}

TEST(DeviceOfARun, IsSaidNotToHelpWhereItDoesNot) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  Opener opener;
  const auto note = [&](auto change) {
    Options options = energy_on(DeviceChoice::Gpu);
    change(options);
    const Result result = run(mesh, options, opener.open());
    EXPECT_EQ(result.device, "");
    return result.notes.empty() ? std::string() : result.notes.back();
  };
  EXPECT_EQ(note([](Options& options) { options.method = Method::Sweeps; }),
            "The run was on the processor: sweeps run on the processor; leave the method at auto or newton.");
  EXPECT_EQ(note([](Options& options) { options.max_iterations = 0; }),
            "The run was on the processor: no step was asked for.");
  EXPECT_EQ(opener.opened, 0);
  // Sweeps make the mesh valid, and then there is nothing to do.
  EXPECT_EQ(note([](Options& options) {
              options.until = Until::Valid;
              options.max_iterations = 1;
            }),
            "The run made no step of Newton's method. The device could only help with certificates and quality.");
}

/// The number with a comma between thousands.
std::string spelled(std::int64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, ",");
  return text;
}

TEST(DeviceOfARun, IsTakenByAutoFromAsManyElementsOnAsTheTextsSay) {
  const std::string said = "at least " + spelled(kLeastElementsOnDevice) + " elements";
  for (const char* file :
       {"/core/options/option_table.cpp", "/proto/varimesh/v1/optimise.proto", "/docs/options.md", "/docs/device.md"}) {
    std::ifstream in(std::string(VARIMESH_SOURCE_DIR) + file);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    EXPECT_NE(text.find(said), std::string::npos) << file;
  }
}

// A run that goes on knows where the steps before the checkpoint were made, also if it has no device itself.
TEST(DeviceOfARun, IsNamedByARunThatGoesOnFromACheckpoint) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  Opener opener;
  std::string checkpoint;
  RunControl control;
  control.open_device = opener.open();
  control.checkpoint_due = [](const Iteration& iteration) { return iteration.on_device; };
  control.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) {
    checkpoint.clear();
    write([&](std::string_view bytes) {
      checkpoint += bytes;
      return true;
    });
  };
  const Options options = energy_on(DeviceChoice::Gpu);
  ASSERT_TRUE(optimise(mesh, options, {}, control));
  ASSERT_FALSE(checkpoint.empty());
  const std::string without = "The run went on on the processor after a part of its steps. There is no driver.";
  const std::vector<std::pair<OpenDevice, std::string>> ways{{opener.open(), ""}, {no_driver(), without}};
  for (const auto& [open, expected] : ways) {
    RunControl again;
    again.open_device = open;
    again.checkpoint = checkpoint;
    const auto result = optimise(mesh, options, {}, again);
    ASSERT_TRUE(result);
    EXPECT_GT(result->resumed_from, 0);
    EXPECT_EQ(result->device, "the processor");
    EXPECT_EQ(result->notes.empty() ? "" : result->notes.back(), expected);
  }
}

TEST(DeviceOfARun, IsOpenedAndToldOnceForAllRunsOfARepair) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  Options options = energy_on(DeviceChoice::Gpu);
  options.repair = Repair::Split;
  Opener opener;
  const Result there = run(mesh, options, opener.open());
  EXPECT_EQ(opener.opened, 1);
  EXPECT_NE(there.device, "");
  EXPECT_TRUE(there.notes.empty()) << there.notes.front();
  const Result none = run(mesh, options, no_driver());
  EXPECT_EQ(none.notes, std::vector<std::string>{"The run was on the processor. There is no driver."});
}

/// Runs with a card that a library in the driver's place has.
class RunOnACard : public ::testing::Test {
 protected:
  void SetUp() override {
    if (device::solver_kernels(3).packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
  void TearDown() override { unsetenv("FAKE_CUDA"); }
  Result on_card(const HighOrderMesh& mesh, const Options& options, const std::string& state) {
    return run(mesh, options, [state] { return testing::fake_card(state); });
  }
};

TEST_F(RunOnACard, HasTheBitsOfTheProcessorInItsPlace) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  Opener opener;
  const Result there = run(mesh, energy_on(DeviceChoice::Gpu), opener.open());
  const Result here = on_card(mesh, energy_on(DeviceChoice::Gpu), "");
  EXPECT_EQ(here.device, "Fake Card 1");
  EXPECT_EQ(here.mesh.coordinates, there.mesh.coordinates);
}

TEST_F(RunOnACard, EndsWholeWithASentenceAfterEachFault) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  const Result usual = run(mesh, energy_on(DeviceChoice::Cpu), {});
  const struct {
    const char* state;
    const char* sentence;
  } faults[] = {{"cards=0", "The NVIDIA driver finds no device."},
                {"version=9020", "The NVIDIA driver is too old"},
                {"capability=60", "is too old"},
                {"busy", "is in use by another process"},
                {"memory=20000", "has no room for"},
                {"load=218", "The driver did not accept the kernels"},
                {"load=222", "The driver cannot compile the kernels"},
                {"launch=701", "cannot run the kernel"},
                {"lost=3", "failed when"}};
  for (const auto& [state, sentence] : faults) {
    SCOPED_TRACE(state);
    const Result result = on_card(mesh, energy_on(DeviceChoice::Gpu), state);
    EXPECT_EQ(result.mesh.coordinates, usual.mesh.coordinates) << "all of it was on the processor";
    EXPECT_EQ(result.device, "");
    ASSERT_EQ(result.notes.size(), 1U);
    EXPECT_EQ(result.notes.front().find("The run was on the processor. "), 0U) << result.notes.front();
    EXPECT_NE(result.notes.front().find(sentence), std::string::npos) << result.notes.front();
  }
}

TEST_F(RunOnACard, JudgesTheCellsOfTheMeshOnTheCardFirst) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  const Result result = on_card(mesh, energy_on(DeviceChoice::Gpu), "lost=1");
  ASSERT_EQ(result.notes.size(), 1U);
  EXPECT_NE(result.notes.front().find("failed when it ran the kernel relative_nodes"), std::string::npos)
      << result.notes.front();
}

TEST_F(RunOnACard, TakesTheCardAgainForALaterStageThatItHasRoomFor) {
  const HighOrderMesh mesh = bent_mesh(0.08);
  Options options = energy_on(DeviceChoice::Gpu);
  options.objective = Objective::Worst;
  RunControl control;
  control.open_device = [] { return testing::fake_card("memory=20000"); };
  int steps = 0;
  const auto result = optimise(
      mesh, options,
      [&](const Iteration& iteration) {
        EXPECT_TRUE(steps > 0 || !iteration.on_device);
        if (iteration.phase == Phase::Newton) ++steps;
        if (steps == 1) setenv("FAKE_CUDA", "", 1);  // another process gives its memory back
        return iteration.on_device ? Control::Stop : Control::Continue;
      },
      control);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->device, "Fake Card 1");
  ASSERT_EQ(result->notes.size(), 1U);
  EXPECT_EQ(result->notes.front().find("A part of the run was on the processor. The device Fake Card 1 has no room"),
            0U)
      << result->notes.front();
}

TEST_F(RunOnACard, HasKernelsForEveryEnergy) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  for (const Energy energy : {Energy::LinearElastic, Energy::Winslow, Energy::Distortion}) {
    Options options = energy_on(DeviceChoice::Gpu);
    options.energy = energy;
    const Result result = on_card(mesh, options, "");
    EXPECT_EQ(result.device, "Fake Card 1");
    EXPECT_TRUE(result.notes.empty());
  }
}

TEST_F(RunOnACard, GoesOnFromTheLastStepIfTheCardIsLost) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  const Result usual = run(mesh, energy_on(DeviceChoice::Cpu), {});
  int in_the_middle = 0;
  for (int launch = 300; launch < 6000 && in_the_middle < 4; launch += 450) {
    const Result result = on_card(mesh, energy_on(DeviceChoice::Gpu), "lost_at_wait=" + std::to_string(launch));
    EXPECT_TRUE(result.converged);
    EXPECT_TRUE(result.after.uncertified.empty());
    EXPECT_NEAR(result.history.back().energy, usual.history.back().energy, 1e-10 * fallen(usual));
    if (result.device.empty() || result.notes.empty()) continue;
    ++in_the_middle;
    EXPECT_EQ(result.notes.front().find("The run went on on the processor after a part of its steps. The device Fake "
                                        "Card 1 failed"),
              0U)
        << result.notes.front();
  }
  EXPECT_GT(in_the_middle, 0);
}

TEST_F(RunOnACard, MakesTheFirstStepAnewIfTheCardIsLostInIt) {
  const HighOrderMesh mesh = bent_mesh(0.01);
  const Result usual = run(mesh, energy_on(DeviceChoice::Cpu), {});
  int lost = 1;
  for (; lost < 2000; lost += 8) {
    const Result result = on_card(mesh, energy_on(DeviceChoice::Gpu), "lost=" + std::to_string(lost));
    if (!result.device.empty()) break;
    ASSERT_EQ(result.mesh.coordinates, usual.mesh.coordinates) << "lost at call " << lost;
  }
  EXPECT_GT(lost, 100);
  EXPECT_LT(lost, 2000);
}

}  // namespace
}  // namespace varimesh
