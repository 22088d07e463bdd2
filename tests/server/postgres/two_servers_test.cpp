// Two schedulers on one database, as two servers have them: one that only takes jobs, and one that runs them.
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <thread>

#include "server/meshes/directory_mesh_store.h"
#include "server/resources/pool.h"
#include "server/scheduling/scheduler.h"
#include "tests/server/postgres/databases.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::milliseconds, std::chrono::seconds;

/// Runs until it is stopped.
Engine endless_engine() {
  Engine engine;
  engine.check_options = [](const Options&) -> Expected<void> { return {}; };
  engine.run = [](RunRequest request, const RunHooks& hooks) -> Expected<RunSummary> {
    RunSummary outcome;
    for (Iteration iteration; !outcome.stopped; std::this_thread::sleep_for(milliseconds(5))) {
      ++iteration.number;
      outcome.stopped = hooks.on_iteration(iteration) == Control::Stop;
    }
    hooks.open_output(v1::MESH_FORMAT_MSH22)(request.input->bytes());
    return outcome;
  };
  return engine;
}

/// A scheduler with a store of its own. Leases are renewed only when a test calls tick().
struct Node {
  Node(const InDatabase& place, DirectoryMeshStore& meshes, std::string name, int threads,
       std::vector<std::string> devices = {}, milliseconds lease = JobStoreSettings().lease) {
    JobStoreSettings settings;
    settings.clock = nullptr;
    settings.lease = lease;
    jobs = InDatabase::open(settings, place.url());
    SchedulerSettings scheduling;
    scheduling.threads = threads;
    scheduling.worker = name;
    scheduling.devices = std::move(devices);
    scheduling.device_names = scheduling.devices.empty() ? "" : "T4";
    scheduling.renewal_interval = milliseconds(0);
    scheduling.new_name = [this, name] { return "jobs/" + name + std::to_string(++names); };
    scheduling.launch = [this](int, SchedulerSettings::Job job) {
      workers.post([job = std::move(job)] { job({[] { return 1; }}); });
    };
    scheduler = std::make_unique<Scheduler>(jobs.get(), &meshes, endless_engine(), std::move(scheduling));
    const auto recovered = scheduler->recover();
    EXPECT_TRUE(recovered) << recovered.error().sentence;
    scheduler->tick();
  }
  ~Node() {
    scheduler->stop(milliseconds(0));
    EXPECT_TRUE(scheduler->drain(std::chrono::steady_clock::now() + seconds(30)));
  }

  std::unique_ptr<JobStore> jobs;
  std::atomic<int> names = 0;
  std::unique_ptr<Scheduler> scheduler;
  Pool workers{2};  ///< Destroyed before the scheduler, whose jobs it runs.
};

class TwoServers : public ::testing::Test {
 protected:
  TwoServers() {
    auto writer = std::move(*meshes_->create());
    EXPECT_TRUE(writer->append("a mesh"));
    spec_.mutable_mesh()->set_digest(writer->commit()->digest);
  }

  std::string submit(v1::Device device = v1::DEVICE_UNSPECIFIED) {
    spec_.mutable_options()->set_device(device);
    const auto job = front_.scheduler->submit("", spec_, false);
    EXPECT_TRUE(job) << job.error().sentence;
    return job ? job->name() : "";
  }
  /// Returns how long it took until the job was in the state, as the front end sees it; a minute if it never was.
  milliseconds wait_for(const std::string& name, v1::JobState state) {
    const auto begun = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - begun < seconds(20)) {
      if (front_.scheduler->get(name)->state() == state)
        return std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - begun);
      std::this_thread::sleep_for(milliseconds(10));
    }
    return seconds(60);
  }

  InDatabase place_;
  std::unique_ptr<DirectoryMeshStore> meshes_ = std::move(*DirectoryMeshStore::create(::testing::TempDir(), {}));
  v1::JobSpec spec_;
  /// Has no job, and need not wait for a lease until it believes that no server lends devices: the database of the
  /// tests may have been started a moment ago.
  Node front_{place_, *meshes_, "front", 0, {}, milliseconds(1)};
  Node worker_{place_, *meshes_, "worker", 1};
};

TEST_F(TwoServers, TellEachOtherOfJobsAndOfCancelRequests) {
  const std::string name = submit();
  EXPECT_LT(wait_for(name, v1::JOB_STATE_RUNNING), seconds(20)) << "nobody has called tick() since";
  const auto cancelled = front_.scheduler->cancel(name);
  ASSERT_TRUE(cancelled) << cancelled.error().sentence;
  EXPECT_EQ(cancelled->state(), v1::JOB_STATE_CANCELLING);
  EXPECT_LT(wait_for(name, v1::JOB_STATE_CANCELLED), seconds(5)) << "much sooner than the next heartbeat";
  std::vector<v1::JobState> states;
  std::int64_t last = 0;
  const auto events = front_.jobs->events(name);
  for (const v1::JobEvent& event : *events) {
    EXPECT_GT(event.sequence(), last);
    last = event.sequence();
    if (event.has_state_change()) states.push_back(event.state_change().state());
  }
  EXPECT_EQ(states, (std::vector<v1::JobState>{v1::JOB_STATE_PENDING, v1::JOB_STATE_RUNNING, v1::JOB_STATE_CANCELLING,
                                               v1::JOB_STATE_CANCELLED}));
  EXPECT_EQ(front_.scheduler->get(name)->results_size(), 1);
}

/// Counts what it is told.
class Watcher : public Listener {
 public:
  void poke() override { ++pokes; }
  std::atomic<int> pokes = 0;
};

TEST_F(TwoServers, LetOneWatchWhatTheOtherRuns) {
  const std::string name = submit();
  const auto log = *front_.scheduler->events(name);
  const auto watcher = std::make_shared<Watcher>();
  log->subscribe(watcher);
  std::vector<v1::JobEvent> seen;
  const auto read = [&] {
    v1::JobEvent event;
    while (log->next(seen.empty() ? 0 : seen.back().sequence(), {}, {}, &event) == EventLog::Next::Event)
      seen.push_back(event);
    return seen.empty() ? v1::JOB_STATE_UNSPECIFIED : log->state();
  };
  const auto is_seen = [&](const std::function<bool()>& enough) {
    for (const auto begun = std::chrono::steady_clock::now(); std::chrono::steady_clock::now() - begun < seconds(20);) {
      read();
      if (enough()) return true;
      std::this_thread::sleep_for(milliseconds(10));
    }
    return false;
  };
  EXPECT_TRUE(is_seen([&] { return log->state() == v1::JOB_STATE_RUNNING; })) << "without a tick";
  EXPECT_TRUE(is_seen([&] {
    front_.scheduler->tick();  // once a second in a server
    return seen.back().has_iteration() && seen.back().iteration().number() > 1;
  }));
  const std::int64_t cursor = seen.back().sequence();
  EXPECT_TRUE((*front_.scheduler->events(name))->can_resume_after(cursor));
  front_.scheduler->cancel(name);
  EXPECT_TRUE(is_seen([&] { return log->state() == v1::JOB_STATE_CANCELLED; }));
  v1::JobEvent event;
  EXPECT_EQ(log->next(seen.back().sequence(), {}, {}, &event), EventLog::Next::End);
  EXPECT_GT(watcher->pokes, 2);
  std::vector<v1::JobState> states;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_GT(seen[i].sequence(), i > 0 ? seen[i - 1].sequence() : 0);
    if (seen[i].has_state_change()) states.push_back(seen[i].state_change().state());
  }
  EXPECT_EQ(states, (std::vector<v1::JobState>{v1::JOB_STATE_PENDING, v1::JOB_STATE_RUNNING, v1::JOB_STATE_CANCELLING,
                                               v1::JOB_STATE_CANCELLED}))
      << "each once";
}

TEST_F(TwoServers, CancelAWaitingJobAtOnce) {
  const std::string running = submit(), waiting = submit();
  wait_for(running, v1::JOB_STATE_RUNNING);
  EXPECT_EQ(front_.scheduler->cancel(waiting)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(front_.scheduler->get(running)->state(), v1::JOB_STATE_RUNNING);
}

TEST_F(TwoServers, StopARunWhoseLeaseWasLostAndThrowItsResultAway) {
  const std::string name = submit();
  wait_for(name, v1::JOB_STATE_RUNNING);
  place_.run("UPDATE jobs SET token = token + 1, worker = 'another'");
  worker_.scheduler->tick();
  // The place is free again when the run has ended.
  const std::string next = submit();
  EXPECT_LT(wait_for(next, v1::JOB_STATE_RUNNING), seconds(20));
  EXPECT_EQ(front_.scheduler->get(name)->state(), v1::JOB_STATE_RUNNING) << "of the other worker";
  EXPECT_EQ(front_.scheduler->get(name)->results_size(), 0);
}

TEST_F(TwoServers, LeaveJobsThatNeedADeviceToOneThatHasSome) {
  const auto worker_of = [&](const std::string& name) {
    return place_.run("SELECT worker FROM jobs WHERE name = '" + name + "'").text(0, 0);
  };
  const std::string first = submit(v1::DEVICE_GPU), second = submit(v1::DEVICE_GPU), plain = submit(v1::DEVICE_AUTO);
  EXPECT_LT(wait_for(plain, v1::JOB_STATE_RUNNING), seconds(5)) << "although others have waited for longer";
  EXPECT_EQ(worker_of(plain), "worker");
  EXPECT_EQ(front_.scheduler->get(first)->state(), v1::JOB_STATE_PENDING);
  EXPECT_EQ(front_.jobs->events(first)->size(), 2u) << "it is told that no device is there";
  EXPECT_EQ(front_.scheduler->lent_devices().devices, 0);
  {
    Node other(place_, *meshes_, "other", 2, {"0"});
    EXPECT_LT(wait_for(first, v1::JOB_STATE_RUNNING), seconds(5));
    EXPECT_EQ(worker_of(first), "other");
    EXPECT_EQ(front_.scheduler->lent_devices().devices, 1);
    EXPECT_EQ(front_.scheduler->lent_devices().names, "T4");
    other.scheduler->tick();
    EXPECT_EQ(worker_of(second), "") << "it does not wait where another job has the device";
    const std::string beside = submit(v1::DEVICE_CPU);
    EXPECT_LT(wait_for(beside, v1::JOB_STATE_RUNNING), seconds(5));
    EXPECT_EQ(worker_of(beside), "other");
    front_.scheduler->cancel(first);
    EXPECT_LT(wait_for(second, v1::JOB_STATE_RUNNING), seconds(5));
    EXPECT_EQ(worker_of(second), "other");
    front_.scheduler->cancel(second);
    front_.scheduler->cancel(beside);
    wait_for(second, v1::JOB_STATE_CANCELLED);
  }
  EXPECT_EQ(front_.scheduler->lent_devices().devices, 0) << "a server that ends takes its devices along";
}

TEST_F(TwoServers, DoNotHoldTheirLockWhileTheDatabaseIsSlow) {
  PostgresConnection other(place_.url());
  other.run("BEGIN; LOCK TABLE jobs IN ACCESS EXCLUSIVE MODE");
  std::thread slow([this] { worker_.scheduler->tick(); });
  std::this_thread::sleep_for(milliseconds(300));
  const auto begun = std::chrono::steady_clock::now();
  worker_.scheduler->stop(milliseconds(0));
  EXPECT_LT(std::chrono::steady_clock::now() - begun, seconds(3)) << "the database lets it wait for 5 s";
  other.run("COMMIT");
  slow.join();
}

}  // namespace
}  // namespace varimesh::server::testing
