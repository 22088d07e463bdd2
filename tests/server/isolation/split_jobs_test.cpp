// Jobs with splits on a real server: they go on from their checkpoints, though they are sequences of runs.
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "core/formats/formats.h"
#include "server/isolation/process_engine.h"
#include "tests/core/support/balls.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

/// The rounds of this job begin after its eleventh iteration.
constexpr int kAmidTheRounds = 35;

std::string ball() {
  std::string bytes;
  const auto written = formats::write(varimesh::testing::two_in_a_ball(3), formats::Format::Msh22, [&](auto part) {
    bytes += part;
    return true;
  });
  EXPECT_TRUE(written);
  return bytes;
}

class SplitJobs : public ::testing::Test {
 protected:
  SplitJobs() {
    std::string name = ::testing::TempDir() + "varimesh-state-XXXXXX";
    state_ = ::mkdtemp(name.data());
  }
  ~SplitJobs() override { std::filesystem::remove_all(state_); }

  /// Runs in processes of their own. Calls `between` after each iteration that a process does.
  ServerOptions options(std::function<void(const Iteration&, const RunHooks&)> between) {
    Engine engine = process_engine({.program = find_worker(), .started = [this](int id) { process_ = id; }});
    engine.run = [this, between, run = engine.run](RunRequest request, const RunHooks& hooks) {
      RunHooks watched = hooks;
      watched.on_iteration = [&](const Iteration& iteration) {
        done_.push_back(iteration.number);
        between(iteration, hooks);
        return hooks.on_iteration(iteration);
      };
      return run(std::move(request), watched);
    };
    ServerOptions options = options_with(std::move(engine));
    options.state = state_.string();
    options.limits.threads = 1;
    options.limits.checkpoint_pause = std::chrono::milliseconds(0);
    return options;
  }

  v1::JobSpec spec(const Service& service) const {
    v1::JobSpec spec = service.spec_for(ball());
    spec.mutable_options()->set_repair(v1::REPAIR_SPLIT);
    spec.mutable_options()->set_objective(v1::OBJECTIVE_ENERGY);
    return spec;
  }

  /// The result of the job as it is without any disturbance.
  v1::Job undisturbed() {
    const Service service([](Engine engine) { return options_with(std::move(engine)); }(core_engine()));
    const v1::Job job = service.wait_for(service.submit(spec(service)).name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
    EXPECT_GT(job.metrics().iterations(), kAmidTheRounds);
    return job;
  }

  void expect_resumed(const v1::Job& job) {
    const v1::Job expected = undisturbed();
    ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.error().message();
    EXPECT_EQ(job.attempt(), 2);
    EXPECT_EQ(job.results(0).digest(), expected.results(0).digest()) << "the same bytes";
    EXPECT_EQ(job.metrics().iterations(), expected.metrics().iterations());
    const auto second = std::ranges::is_sorted_until(done_);
    EXPECT_LT(done_.size(), std::size_t(expected.metrics().iterations()) + 20) << "it did not begin again";
    if (second != done_.end()) {
      EXPECT_GT(*second, 11) << "the run before the rounds is not done again";
    }
  }

  std::filesystem::path state_;
  std::atomic<int> process_ = 0;
  std::vector<int> done_;
};

TEST_F(SplitJobs, GoOnAmidTheRoundsAfterTheirProcessWasKilled) {
  bool killed = false;
  const Service service(options([&](const Iteration& iteration, const RunHooks&) {
    if (iteration.number != kAmidTheRounds || std::exchange(killed, true)) return;
    EXPECT_GE(iteration.groups_left, 0);
    ::kill(process_, SIGKILL);
  }));
  const v1::Job job = service.wait_for(service.submit(spec(service)).name());
  EXPECT_TRUE(killed);
  expect_resumed(job);
}

TEST_F(SplitJobs, GoOnAmidTheRoundsAfterTheirServerWasDrained) {
  std::string name;
  std::atomic<bool> reached = false;
  {
    const Service service(options([&](const Iteration& iteration, const RunHooks& hooks) {
      if (iteration.number != kAmidTheRounds) return;
      reached = true;
      while (!hooks.given_up()) std::this_thread::yield();
    }));
    name = service.submit(spec(service)).name();
    while (!reached) std::this_thread::yield();
    EXPECT_TRUE(service.server->stop(std::chrono::seconds(20)));
  }
  const Service service(options([](const Iteration&, const RunHooks&) {}));
  const v1::Job job = service.wait_for(name);
  EXPECT_TRUE(std::ranges::is_sorted(done_)) << "no iteration was done twice";
  expect_resumed(job);
}

}  // namespace
}  // namespace varimesh::server::testing
