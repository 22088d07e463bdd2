// The scheduler with its stores, called by many threads at the same time while jobs run.
#include "server/scheduling/scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/meshes/directory_mesh_store.h"
#include "server/resources/pool.h"
#include "tests/server/jobs/job_stores.h"

namespace varimesh::server::testing {
namespace {

/// Runs 20 iterations and returns the input.
Engine small_engine() {
  Engine engine;
  engine.check_options = [](const Options&) -> Expected<void> { return {}; };
  engine.run = [](RunRequest request, const RunHooks& hooks) -> Expected<RunSummary> {
    RunSummary outcome;
    for (int i = 1; i <= 20; ++i) {
      Iteration iteration;
      iteration.number = i;
      outcome.history.push_back(iteration);
      if (hooks.on_iteration(iteration) == Control::Stop) {
        outcome.stopped = true;
        break;
      }
    }
    if (!hooks.open_output(v1::MESH_FORMAT_MSH22)(request.input->bytes()))
      return tl::unexpected(Error{Error::Kind::Output, "The store is full."});
    return outcome;
  };
  return engine;
}

/// A scheduler with its stores and threads.
struct RunningScheduler {
  explicit RunningScheduler(const StoreKind& kind)
      : place(kind.make()),
        jobs(place->open({})),
        meshes(std::move(*DirectoryMeshStore::create(::testing::TempDir(), {}))) {
    auto writer = std::move(*meshes->create());
    EXPECT_TRUE(writer->append("a mesh"));
    digest = writer->commit()->digest;
    SchedulerSettings settings;
    settings.threads = 3;
    settings.max_ended = 10;
    settings.memory = 1000;
    settings.renewal_interval = std::chrono::seconds(0);
    settings.new_name = [this] { return "jobs/" + std::to_string(++names); };
    settings.launch = [this](int, SchedulerSettings::Job job) {
      workers.post([job = std::move(job)] { job({[] { return 1; }}); });
    };
    scheduler = std::make_unique<Scheduler>(jobs.get(), meshes.get(), small_engine(), std::move(settings));
  }
  ~RunningScheduler() {
    scheduler->stop();
    EXPECT_TRUE(scheduler->drain(std::chrono::steady_clock::now() + std::chrono::seconds(30)));
  }

  v1::JobSpec spec() const {
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(digest);
    return spec;
  }
  /// Reads the events of a job to their end.
  void follow(const std::string& name) {
    const auto log = scheduler->events(name);
    if (!log) return;  // the job was deleted meanwhile
    std::int64_t last = 0;
    v1::JobEvent event;
    for (auto next = EventLog::Next::Wait; next != EventLog::Next::End;) {
      next = (*log)->next(last, {}, {}, &event);
      if (next == EventLog::Next::Wait) std::this_thread::yield();
      if (next == EventLog::Next::Event) last = event.sequence();
    }
    EXPECT_TRUE(has_ended(event.state_change().state()));
  }

  std::unique_ptr<StorePlace> place;
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<DirectoryMeshStore> meshes;
  std::string digest;
  std::atomic<int> names = 0;
  std::unique_ptr<Scheduler> scheduler;
  Pool workers{3};  ///< Destroyed before the scheduler, whose jobs it runs.
};

class SchedulerConcurrency : public ::testing::TestWithParam<StoreKind> {};
INSTANTIATE_TEST_SUITE_P(Stores, SchedulerConcurrency, ::testing::ValuesIn(kStores), name_of);

TEST_P(SchedulerConcurrency, ServesManyThreadsAtTheSameTime) {
  RunningScheduler running(GetParam());
  std::atomic<bool> done = false;
  std::thread ticker([&] {
    while (!done) {
      running.scheduler->tick();
      running.meshes->sweep();
    }
  });
  std::vector<std::thread> clients;
  for (int client = 0; client < 4; ++client)
    clients.emplace_back([&, client] {
      for (int i = 0; i < 30; ++i) {
        const auto job = running.scheduler->submit("", running.spec(), false);
        ASSERT_TRUE(job) << job.error().sentence;
        if (i % 3 == client % 3) running.scheduler->cancel(job->name());
        running.follow(job->name());
        if (i % 2 == 0) running.scheduler->remove(job->name());
        running.scheduler->list({}, 5, "");
      }
    });
  for (std::thread& client : clients) client.join();
  done = true;
  ticker.join();
}

TEST_P(SchedulerConcurrency, MakesOneJobPerRequest) {
  RunningScheduler running(GetParam());
  std::vector<std::string> names(10);
  std::vector<std::thread> clients;
  for (std::string& name : names)
    clients.emplace_back([&] { name = running.scheduler->submit("the same", running.spec(), false)->name(); });
  for (std::thread& client : clients) client.join();
  for (const std::string& name : names) EXPECT_EQ(name, names.front());
  EXPECT_EQ(running.scheduler->list({}, 0, "")->jobs.size(), 1u);
}

TEST_P(SchedulerConcurrency, RefusesAMeshThatTakesMoreMemoryThanAllJobsHave) {
  RunningScheduler running(GetParam());
  auto writer = std::move(*running.meshes->create());
  ASSERT_TRUE(writer->append(std::string(6000, 'x')));
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(writer->commit()->digest);
  const auto refused = running.scheduler->submit("large", spec, true);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "MESH_TOO_LARGE");
  EXPECT_NE(refused.error().sentence.find("1200 bytes of memory"), std::string::npos) << refused.error().sentence;
}

TEST_P(SchedulerConcurrency, RefusesASpecThatFitsInNoMessage) {
  RunningScheduler running(GetParam());
  v1::JobSpec spec = running.spec();
  spec.mutable_options()->add_fix(std::string(3'000'000, 'n'));
  const auto refused = running.scheduler->submit("", spec, true);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, "BAD_REQUEST");
}

TEST_P(SchedulerConcurrency, StopsDuringSubmissions) {
  for (int round = 0; round < 10; ++round) {
    RunningScheduler running(GetParam());
    std::vector<std::thread> clients;
    for (int client = 0; client < 3; ++client)
      clients.emplace_back([&] {
        for (int i = 0; i < 10; ++i) running.scheduler->submit("", running.spec(), false);
      });
    running.scheduler->stop();
    for (std::thread& client : clients) client.join();
  }
}

}  // namespace
}  // namespace varimesh::server::testing
