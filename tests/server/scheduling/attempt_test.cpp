// One attempt at a job, with an engine of the test's own.
#include "server/scheduling/attempt.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

class AttemptTest : public ::testing::Test {
 protected:
  AttemptTest() : meshes_(new_store()) {
    claim_.name = "jobs/1";
    claim_.attempt = 1;
    claim_.spec.mutable_mesh()->set_digest(write(*meshes_, "a mesh").digest);
  }

  Ending run(std::function<Expected<RunSummary>(RunRequest, const RunHooks&)> work) {
    Engine engine;
    engine.run = std::move(work);
    const LentThreads threads{[] { return 2; }};
    Attempt attempt{claim_,
                    engine,
                    *meshes_,
                    log_,
                    threads,
                    memory_,
                    [this] { return wall_; },
                    [this] { return now_; },
                    [this] { return cancelled_; },
                    [this] { return stopping_; },
                    [this](const v1::Iteration& iteration) { noted_.push_back(iteration.number()); },
                    std::chrono::milliseconds(0),
                    [this](const CheckpointReference& checkpoint) {
                      checkpoints_.push_back(checkpoint);
                      return records_;
                    }};
    attempt.kernels_worked = [this](const KernelWork& work) { worked_.push_back(work.operations); };
    return run_attempt(attempt);
  }

  static Iteration iteration(int number) {
    Iteration iteration;
    iteration.number = number;
    return iteration;
  }

  std::unique_ptr<DirectoryMeshStore> meshes_;
  Claim claim_;
  EventLog log_;
  MemoryBudget memory_{1000};
  /// Whether so much of it is free.
  bool others_get(std::int64_t bytes) {
    MemoryBudget::Share share;
    const bool taken = memory_.exchange(share, bytes, [] { return true; });
    memory_.give_back(share, share.bytes);
    return taken;
  }
  TimePoint wall_ = TimePoint(std::chrono::hours(1));
  Time now_ = Time(std::chrono::hours(1));
  bool cancelled_ = false, stopping_ = false;
  bool records_ = true;  ///< Whether checkpoints can be recorded.
  std::vector<int> noted_;
  std::vector<double> worked_;  ///< Operations of the kernels, as they were told.
  std::vector<CheckpointReference> checkpoints_;
};

TEST_F(AttemptTest, StoresTheResultAndTheHistory) {
  const Ending ending = run([](RunRequest request, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_EQ(request.options.threads, 2);
    EXPECT_TRUE(hooks.open_output(v1::MESH_FORMAT_MSH22)(request.input->bytes()));
    RunSummary outcome;
    outcome.history = {iteration(1)};
    return outcome;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_SUCCEEDED);
  ASSERT_EQ(ending.results.size(), 1u);
  EXPECT_EQ((*meshes_->open(ending.results[0].digest()))->bytes(), "a mesh");
  v1::History history;
  const auto stored = *meshes_->open(ending.history_digest);
  ASSERT_TRUE(history.ParseFromString(std::string(stored->bytes())));
  EXPECT_EQ(history.iterations_size(), 1);
}

TEST_F(AttemptTest, LogsEveryIterationAndReportsSomeToTheStore) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    for (int i = 1; i <= 5; ++i) {
      EXPECT_EQ(hooks.on_iteration(iteration(i)), Control::Continue);
      now_ += std::chrono::milliseconds(300);
    }
    return RunSummary();
  });
  EXPECT_EQ(log_.last_sequence(), 5);
  EXPECT_EQ(noted_, (std::vector<int>{1, 3, 5})) << "at most one every 500 ms";
}

TEST_F(AttemptTest, ShowsTheWorkInsideAnIterationAndKeepsNoneOfIt) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    WorkMeter* meter = hooks.control.meter;
    if (meter == nullptr) return tl::unexpected(Error{Error::Kind::Internal, "no meter"});
    meter->found_groups(3);
    meter->begin(Activity::Assembly, 8);
    meter->add(4);
    std::int64_t seen = 0;
    const auto work = log_.work_after(seen);
    EXPECT_TRUE(work);
    EXPECT_EQ(work->activity(), v1::Work::ACTIVITY_ASSEMBLY);
    EXPECT_EQ(work->done(), 4);
    EXPECT_EQ(work->of(), 8);
    EXPECT_EQ(work->groups_left(), 3);
    EXPECT_EQ(log_.last_sequence(), 0) << "work has no number";
    hooks.on_iteration(iteration(1));
    return RunSummary{};
  });
  EXPECT_EQ(log_.last_sequence(), 1);
}

TEST_F(AttemptTest, TellsWhatTheKernelsHaveDoneAfterEveryIterationAndHoweverItEnds) {
  const auto work = [](double operations) {
    return [operations](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
      hooks.control.meter->add_kernels({operations, 1});
      hooks.on_iteration(iteration(1));
      hooks.control.meter->add_kernels({2 * operations, 1});
      hooks.on_iteration(iteration(2));
      hooks.control.meter->add_kernels({4 * operations, 1});
      if (operations == 1) return RunSummary();
      if (operations == 10) return bad_input("Byte 0 is bad.");
      throw std::runtime_error("broken");
    };
  };
  for (const double operations : {1, 10, 100}) run(work(operations));
  EXPECT_EQ(worked_, (std::vector<double>{1, 2, 4, 10, 20, 40, 100, 200, 400}));
}

TEST_F(AttemptTest, ReleasesTheOutputsOfARunThatFails) {
  std::string digest;
  const Ending ending = run([&](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    hooks.open_output(v1::MESH_FORMAT_MSH22)("a result");
    hooks.open_output(v1::MESH_FORMAT_VTU)("another");
    digest = sha256("a result");
    EXPECT_TRUE(meshes_->open(digest));
    return bad_input("Byte 0 is bad.");
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_FAILED);
  EXPECT_EQ(ending.error->reason(), "BAD_INPUT");
  EXPECT_FALSE(meshes_->open(digest));
}

TEST_F(AttemptTest, FailsWithASentenceAfterAnException) {
  const Ending ending =
      run([](RunRequest, const RunHooks&) -> Expected<RunSummary> { throw std::runtime_error("out of luck"); });
  EXPECT_EQ(ending.state, v1::JOB_STATE_FAILED);
  EXPECT_EQ(ending.error->reason(), "INTERNAL");
  EXPECT_NE(ending.error->message().find("out of luck"), std::string::npos);
}

TEST_F(AttemptTest, IsPendingAgainIfTheServerStops) {
  const Ending ending = run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    stopping_ = true;
    EXPECT_TRUE(hooks.control.checkpoint_due(iteration(3))) << "one more before the server stops";
    hooks.control.save_checkpoint(iteration(3), [](const CheckpointSink& sink) { return sink("state"); });
    RunSummary outcome;
    outcome.stopped = hooks.on_iteration(iteration(3)) == Control::Stop;
    EXPECT_TRUE(hooks.given_up());
    return outcome;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_PENDING);
  ASSERT_EQ(checkpoints_.size(), 1u);
  EXPECT_EQ(checkpoints_[0].iteration, 3);
  EXPECT_EQ(checkpoints_[0].digest, sha256("state"));
}

TEST_F(AttemptTest, DoesNotCountACheckpointThatTheStoreHasNotRecorded) {
  records_ = false;
  const Ending ending = run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    const auto save = [&](int number) {
      EXPECT_TRUE(hooks.control.checkpoint_due(iteration(number))) << number;
      hooks.control.save_checkpoint(iteration(number), [](const CheckpointSink& sink) { return sink("state"); });
    };
    save(10);
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(9))) << "not at once again";
    now_ += std::chrono::seconds(30);
    records_ = true;
    save(10);
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(10))) << "it is recorded now";
    stopping_ = true;
    records_ = false;
    save(12);
    RunSummary outcome;
    EXPECT_EQ(hooks.on_iteration(iteration(12)), Control::Continue) << "the server has time to try the next one";
    records_ = true;
    save(13);
    outcome.stopped = hooks.on_iteration(iteration(13)) == Control::Stop;
    return outcome;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_PENDING);
  EXPECT_EQ(checkpoints_.size(), 4u);
}

TEST_F(AttemptTest, GoesOnToTheNextIterationThatCanBeSavedIfTheServerStops) {
  const Ending ending = run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    const auto save = [&](int number) {
      EXPECT_TRUE(hooks.control.checkpoint_due(iteration(number)));
      hooks.control.save_checkpoint(iteration(number), [](const CheckpointSink& sink) { return sink("state"); });
    };
    // Like sweeps, which can be saved after each tenth.
    save(10);
    EXPECT_EQ(hooks.on_iteration(iteration(10)), Control::Continue);
    for (int i = 11; i < 20; ++i) {
      if (i == 13) stopping_ = true;
      EXPECT_EQ(hooks.on_iteration(iteration(i)), Control::Continue) << "stopped here, the work since 10 would be lost";
    }
    save(20);
    RunSummary outcome;
    outcome.stopped = hooks.on_iteration(iteration(20)) == Control::Stop;
    return outcome;
  });
  EXPECT_EQ(ending.state, v1::JOB_STATE_PENDING);
  EXPECT_EQ(checkpoints_.back().iteration, 20);
}

TEST_F(AttemptTest, StopsAfterAWhileIfNothingCanBeSaved) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    stopping_ = true;
    EXPECT_EQ(hooks.on_iteration(iteration(1)), Control::Continue);
    now_ += std::chrono::seconds(10);
    EXPECT_EQ(hooks.on_iteration(iteration(2)), Control::Stop);
    return RunSummary();
  });
  stopping_ = false;
  claim_.spec.mutable_options()->set_repair(v1::REPAIR_SPLIT);
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    stopping_ = true;
    EXPECT_EQ(hooks.on_iteration(iteration(1)), Control::Continue) << "splits have checkpoints too";
    return RunSummary();
  });
}

TEST_F(AttemptTest, InterruptsAnIterationAtOnceIfCancelledAndAfterAWhileIfTheServerStops) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_FALSE(hooks.control.stop_asked());
    stopping_ = true;
    EXPECT_FALSE(hooks.control.stop_asked()) << "an iteration that ends soon can still be saved";
    now_ += std::chrono::milliseconds(9999);
    EXPECT_FALSE(hooks.control.stop_asked());
    now_ += std::chrono::milliseconds(1);
    EXPECT_TRUE(hooks.control.stop_asked());
    stopping_ = false;
    EXPECT_FALSE(hooks.control.stop_asked());
    cancelled_ = true;
    EXPECT_TRUE(hooks.control.stop_asked());
    return RunSummary();
  });
}

TEST_F(AttemptTest, ContinuesFromTheCheckpointOfItsClaim) {
  claim_.checkpoint = CheckpointReference{write(*meshes_, "state").digest, 7};
  run([](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_EQ(hooks.control.checkpoint, "state");
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(7))) << "that one is already saved";
    return RunSummary();
  });
  claim_.checkpoint = CheckpointReference{sha256("lost"), 7};
  run([](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_TRUE(hooks.control.checkpoint.empty()) << "from the beginning";
    return RunSummary();
  });
}

TEST_F(AttemptTest, SavesACheckpointAfterTenIterationsOrHalfAMinute) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(9)));
    EXPECT_TRUE(hooks.control.checkpoint_due(iteration(10)));
    now_ += std::chrono::seconds(30);
    EXPECT_TRUE(hooks.control.checkpoint_due(iteration(1)));
    return RunSummary();
  });
}

TEST_F(AttemptTest, SavesEachOfManyLongIterations) {
  claim_.checkpoint = CheckpointReference{write(*meshes_, "state").digest, 7};
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    now_ += std::chrono::seconds(4);
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(8)));
    now_ += std::chrono::seconds(5);
    EXPECT_TRUE(hooks.control.checkpoint_due(iteration(9)));
    now_ += std::chrono::seconds(1);
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(10)));
    return RunSummary();
  });
}

TEST_F(AttemptTest, RefusesAMeshThatNeedsMoreMemoryThanThereIs) {
  run([](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    const auto too_large = hooks.admit_reading(1001, 2000);
    EXPECT_FALSE(too_large) << "before it is read";
    EXPECT_NE(too_large.error().sentence.find("takes at least"), std::string::npos);
    EXPECT_TRUE(hooks.admit(1000));
    const auto refused = hooks.admit(1001);
    EXPECT_FALSE(refused);
    EXPECT_NE(refused.error().sentence.find("--max-memory-bytes"), std::string::npos);
    return RunSummary();
  });
  EXPECT_TRUE(others_get(1000)) << "the memory was given back";
}

TEST_F(AttemptTest, TakesTheMemoryForReadingBeforeTheMeshIsRead) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_TRUE(hooks.admit_reading(200, 800).value_or(false));
    EXPECT_FALSE(others_get(201)) << "it is taken";
    EXPECT_TRUE(hooks.admit(300).value_or(false));
    EXPECT_FALSE(others_get(701));
    EXPECT_TRUE(others_get(700)) << "what is not needed any more was given back";
    return RunSummary();
  });
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_TRUE(hooks.admit_reading(200, 5000).value_or(false)) << "it gets all that there is";
    EXPECT_FALSE(others_get(1));
    return RunSummary();
  });
  EXPECT_TRUE(others_get(1000));
}

TEST_F(AttemptTest, SavesCheckpointsAlthoughTheClockIsSetBack) {
  run([this](RunRequest, const RunHooks& hooks) -> Expected<RunSummary> {
    EXPECT_FALSE(hooks.control.checkpoint_due(iteration(1)));
    wall_ -= std::chrono::minutes(50);
    now_ += std::chrono::seconds(30);
    EXPECT_TRUE(hooks.control.checkpoint_due(iteration(2)));
    hooks.on_iteration(iteration(2));
    return RunSummary();
  });
  EXPECT_EQ(noted_, std::vector<int>{2});
}

}  // namespace
}  // namespace varimesh::server::testing
