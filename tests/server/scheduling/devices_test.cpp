// Which device an attempt has, with an engine of the test's own.
#include <gtest/gtest.h>

#include "server/scheduling/attempt.h"
#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

class AttemptWithDevices : public ::testing::Test {
 protected:
  AttemptWithDevices() : meshes_(new_store()) {
    claim_.name = "jobs/1";
    claim_.attempt = 1;
    claim_.spec.mutable_mesh()->set_digest(write(*meshes_, "a mesh").digest);
    ask_for(v1::DEVICE_GPU);
  }

  void ask_for(v1::Device device) { claim_.spec.mutable_options()->set_device(device); }

  /// What the run is told of its device.
  RunRequest run(
      DeviceBudget* devices, Ending* ending = nullptr,
      const std::function<void(const RunHooks&)>& work = [](const auto&) {}) {
    RunRequest seen;
    Engine engine;
    engine.uses_device = [this](const Options&) { return can_use_; };
    engine.run = [&](RunRequest request, const RunHooks& hooks) -> Expected<RunOutcome> {
      ++runs_;
      seen.device = request.device;
      seen.why_no_device = request.why_no_device;
      work(hooks);
      return RunSummary();
    };
    const LentThreads threads{[] { return 2; }, [this](bool rests) { rests_ += rests ? 1 : -1; }};
    Attempt attempt{claim_,
                    engine,
                    *meshes_,
                    log_,
                    threads,
                    memory_,
                    [] { return TimePoint(std::chrono::hours(1)); },
                    [] { return SteadyTime(std::chrono::hours(1)); },
                    [this] { return cancelled_ && cancelled_(); },
                    [] { return false; },
                    [](const v1::Iteration&) {},
                    std::chrono::milliseconds(0),
                    nullptr};
    attempt.devices = devices;
    Ending ended = run_attempt(attempt);
    if (ending != nullptr) *ending = std::move(ended);
    return seen;
  }

  static std::vector<std::string> notes(const Ending& ending) {
    const auto& notes = ending.metrics->notes();
    return {notes.begin(), notes.end()};
  }

  std::unique_ptr<DirectoryMeshStore> meshes_;
  Claim claim_;
  EventLog log_;
  MemoryBudget memory_{1000};
  std::function<bool()> cancelled_;
  bool can_use_ = true;
  int runs_ = 0, rests_ = 0;
};

TEST_F(AttemptWithDevices, HasOneIfItAsksForOneAndCanUseIt) {
  DeviceBudget devices({"3"});
  EXPECT_EQ(run(&devices).device, "3");
  EXPECT_EQ(devices.jobs(), 0) << "it is given back";
  ask_for(v1::DEVICE_AUTO);
  EXPECT_EQ(run(&devices).device, "3");
  ask_for(v1::DEVICE_CPU);
  EXPECT_EQ(run(&devices).device, "");
  ask_for(v1::DEVICE_GPU);
  can_use_ = false;
  EXPECT_EQ(run(&devices).device, "");
  can_use_ = true;
  claim_.spec.mutable_quality();
  EXPECT_EQ(run(&devices).device, "") << "a judgement makes no steps";
}

TEST_F(AttemptWithDevices, HasNoneOnAServerWithout) {
  DeviceBudget none;
  for (DeviceBudget* const devices : {static_cast<DeviceBudget*>(nullptr), &none}) {
    const RunRequest seen = run(devices);
    EXPECT_EQ(seen.device, "");
    EXPECT_EQ(seen.why_no_device, "") << "the engine says why";
  }
}

TEST_F(AttemptWithDevices, WaitsForOneAndTheResultSaysSo) {
  DeviceBudget devices({"0"});
  auto other = devices.take_free();
  int asked = 0;
  cancelled_ = [&] {
    if (++asked == 3) {
      EXPECT_EQ(rests_, 1) << "other jobs have its threads";
      EXPECT_EQ(log_.last_sequence(), 1) << "people are told";
      other.reset();
    }
    return false;
  };
  Ending ending;
  EXPECT_EQ(run(&devices, &ending).device, "0");
  EXPECT_EQ(rests_, 0);
  EXPECT_EQ(ending.state, v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(notes(ending), std::vector<std::string>{"The job waited 1 s for a device of this server."});
}

TEST_F(AttemptWithDevices, IsCancelledWhileItWaits) {
  DeviceBudget devices({"0"});
  const auto other = devices.take_free();
  cancelled_ = [] { return true; };
  Ending ending;
  run(&devices, &ending);
  EXPECT_EQ(runs_, 0);
  EXPECT_EQ(rests_, 0);
  EXPECT_EQ(ending.state, v1::JOB_STATE_CANCELLED);
}

TEST_F(AttemptWithDevices, DoesNotWaitIfItTakesWhatThereIs) {
  DeviceBudget devices({"0"});
  const auto other = devices.take_free();
  ask_for(v1::DEVICE_AUTO);
  const RunRequest seen = run(&devices);
  EXPECT_EQ(seen.device, "");
  EXPECT_EQ(seen.why_no_device, "All devices of this server were taken when the job began.");
}

TEST_F(AttemptWithDevices, HasNoneAfterAProcessWasLost) {
  DeviceBudget devices({"0"});
  claim_.lost = 1;
  const RunRequest seen = run(&devices);
  EXPECT_EQ(seen.device, "");
  EXPECT_NE(seen.why_no_device.find("perhaps because of the device"), std::string::npos);
}

TEST_F(AttemptWithDevices, GivesBackWhatItDoesNotUse) {
  DeviceBudget devices({"0"});
  run(&devices, nullptr, [&](const RunHooks& hooks) {
    EXPECT_EQ(devices.jobs(), 1);
    hooks.device_unused();
    EXPECT_EQ(devices.jobs(), 0);
  });
}

}  // namespace
}  // namespace varimesh::server::testing
