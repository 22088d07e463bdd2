// Servers that follow each other on one state directory. tests/faults also kills them.
#include <filesystem>
#include <fstream>

#include "server/jobs/sqlite_jobs.h"
#include "tests/server/service.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

class Restart : public ::testing::Test {
 protected:
  Restart() {
    std::string name = ::testing::TempDir() + "varimesh-state-XXXXXX";
    state_ = ::mkdtemp(name.data());
  }
  ~Restart() override { std::filesystem::remove_all(state_); }

  ServerOptions options(Engine engine) {
    ServerOptions options = options_with(std::move(engine));
    options.state = state_.string();
    options.limits.threads = 1;
    return options;
  }

  std::filesystem::path state_;
};

TEST_F(Restart, KeepsJobsThatHaveEnded) {
  std::string name, digest;
  std::vector<v1::JobEvent> events;
  {
    const Service service(options(echo_engine(5)));
    name = service.submit(service.spec_for("a mesh")).name();
    digest = service.wait_for(name).results(0).digest();
    events = service.watch(name);
  }
  const Service service(options(echo_engine()));
  const v1::Job job = service.get(name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(service.download(digest), "a mesh");
  EXPECT_EQ(service.upload("a mesh"), digest) << "the server knows the mesh";
  const WatchHistory history{{0, service.watch(name)}};
  EXPECT_EQ(broken_order(history), "");
  EXPECT_EQ(broken_reliability(history, events), "");
  EXPECT_EQ(broken_resumption(history), "") << "its iterations are skipped and counted";
  EXPECT_EQ(service.watch(name, 3).front().thinned(), 4) << "a watch continues after the third event";
}

TEST_F(Restart, RunsWaitingJobsAndContinuesRunningOnes) {
  std::string running, waiting;
  WatchHistory history;
  std::atomic<int> begun = 0;
  {
    // The job runs until the server stops.
    Engine engine = echo_engine(40, [&](int) { ++begun; });
    engine.run = [run = engine.run](RunRequest request, const RunHooks& hooks) {
      RunHooks waiting = hooks;
      waiting.control.checkpoint_due = [&](const Iteration& iteration) {
        while (iteration.number == 20 && !hooks.given_up()) std::this_thread::yield();
        return hooks.control.checkpoint_due(iteration);
      };
      return run(std::move(request), waiting);
    };
    Service service(options(std::move(engine)));
    running = service.submit(service.spec_for("the first")).name();
    waiting = service.submit(service.spec_for("the second")).name();
    history.push_back({0, service.watch(running, 0, 15)});
    EXPECT_TRUE(service.server->stop(std::chrono::seconds(20)));
    EXPECT_EQ(begun, 20);
  }
  begun = 0;
  const Service service(options(echo_engine(40, [&](int) { ++begun; })));
  const std::int64_t last = history.back().events.back().sequence();
  history.push_back({last, service.watch(running, last)});
  const v1::Job first = service.wait_for(running), second = service.wait_for(waiting);
  EXPECT_EQ(first.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(first.attempt(), 2);
  EXPECT_EQ(first.metrics().iterations(), 40);
  EXPECT_EQ(service.download(first.results(0).digest()), "the first");
  EXPECT_EQ(second.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(second.attempt(), 1);
  EXPECT_EQ(begun, 20 + 40) << "the first job continued from the checkpoint that was saved when the server stopped";
  EXPECT_EQ(broken_order(history), "");
  EXPECT_EQ(broken_uniqueness(history), "");
  EXPECT_EQ(broken_resumption(history), "");
  EXPECT_EQ(broken_reliability(history, service.watch(running)), "");
}

TEST_F(Restart, LeavesAJobThatDoesNotEndToTheNextServer) {
  std::string name;
  for (int round = 1; round <= 4; ++round) {
    Gate stopped;  // declared before the service, whose job waits for it
    Service service(options(echo_engine(3, [&](int) { stopped.wait(); })));
    if (round == 1) name = service.submit(service.spec_for("a mesh")).name();
    while (service.get(name).state() != v1::JOB_STATE_RUNNING) std::this_thread::yield();
    EXPECT_FALSE(service.server->stop(std::chrono::milliseconds(1)));
    {
      const auto store = open_sqlite_jobs(state_ / "jobs.sqlite");
      const auto job = (*store)->get(name);
      EXPECT_EQ(job->state(), v1::JOB_STATE_PENDING) << "whatever happens to the process now";
      EXPECT_EQ(job->attempt(), round);
    }
    stopped.open();
  }
  const Service service(options(echo_engine()));
  EXPECT_EQ(service.wait_for(name).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Restart, KnowsEarlierRequestIds) {
  std::string name;
  v1::JobSpec spec;
  {
    const Service service(options(echo_engine()));
    spec = service.spec_for("a mesh");
    v1::Job job;
    ASSERT_TRUE(service.submit("id", spec, &job).ok());
    name = job.name();
    service.wait_for(name);
  }
  const Service service(options(echo_engine()));
  v1::Job job;
  ASSERT_TRUE(service.submit("id", spec, &job).ok());
  EXPECT_EQ(job.name(), name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Restart, LeavesNoFilesOfADeletedJob) {
  std::string name;
  {
    const Service service(options(echo_engine()));
    name = service.wait_for(service.submit(service.spec_for("a mesh")).name()).name();
  }
  const Service service(options(echo_engine()));
  grpc::ClientContext context;
  v1::DeleteJobRequest request;
  request.set_name(name);
  v1::DeleteJobResponse response;
  ASSERT_TRUE(service.jobs->DeleteJob(&context, request, &response).ok());
  EXPECT_TRUE(std::filesystem::is_empty(state_ / "meshes"));
}

TEST_F(Restart, CreatesFilesThatOnlyTheirOwnerCanRead) {
  for (const char* ending : {"plain", "deep/separator/", "deep/separators//", "deep/dot/."}) {
    ServerOptions deep = options(echo_engine());
    deep.state = (state_ / ending).string();
    const Service service(std::move(deep));
    const auto rights = [](const std::filesystem::path& path) { return std::filesystem::status(path).permissions(); };
    EXPECT_EQ(rights(state_ / ending), std::filesystem::perms::owner_all) << ending;
    for (const char* file : {"jobs.sqlite", "jobs.sqlite-wal"})
      EXPECT_EQ(rights(state_ / ending / file) & std::filesystem::perms(077), std::filesystem::perms::none) << file;
  }
}

TEST_F(Restart, IsRefusedIfTheMeshesHaveLostTheirJobs) {
  {
    const Service service(options(echo_engine()));
    service.wait_for(service.submit(service.spec_for("a mesh")).name());
  }
  for (const bool is_empty : {false, true}) {
    for (const char* ending : {"", "-wal", "-shm"})
      std::filesystem::remove(state_ / (std::string("jobs.sqlite") + ending));
    if (is_empty) std::ofstream(state_ / "jobs.sqlite").close();
    const auto refused = Server::start(options(echo_engine()));
    ASSERT_FALSE(refused) << "it would delete the meshes as nobody's";
    EXPECT_NE(refused.error().sentence.find("restore"), std::string::npos) << refused.error().sentence;
    EXPECT_FALSE(std::filesystem::is_empty(state_ / "meshes"));
  }
  std::filesystem::rename(state_ / "meshes", state_ / "away");
  const Service service(options(echo_engine()));
}

TEST_F(Restart, AllowsOneServerPerDirectory) {
  const Service first(options(echo_engine()));
  const auto second = Server::start(options(echo_engine()));
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().sentence.find("another varimeshd"), std::string::npos) << second.error().sentence;
}

}  // namespace
}  // namespace varimesh::server::testing
