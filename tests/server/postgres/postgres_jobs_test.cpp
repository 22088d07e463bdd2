// Tests of what only the store in PostgreSQL does: the database's clock, lost connections, several processes.
#include "server/postgres/postgres_jobs.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/jobs/timestamps.h"
#include "tests/server/postgres/cutting_socket.h"
#include "tests/server/postgres/databases.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::milliseconds, std::chrono::seconds;

/// A store on the database's clock, which is reached through a socket that can be cut.
class PostgresStore : public ::testing::Test {
 protected:
  PostgresStore() { reopen(seconds(30)); }

  void reopen(milliseconds lease) {
    store_.reset();
    JobStoreSettings settings;
    settings.clock = nullptr;
    settings.lease = lease;
    store_ = InDatabase::open(settings, place_.url(socket_.folder()));
  }
  static std::string server_folder() {
    const std::string url = database_server().url;
    const std::size_t begin = url.find("host=") + 5;
    return url.substr(begin, url.find('&', begin) - begin);
  }
  Answer<Changed> submit(const std::string& request_id = {}) {
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest("mesh");
    return store_->submit({request_id, spec, "jobs/" + std::to_string(++names_), 1000, {}, 0});
  }
  std::string end_one_with_webhook() {
    v1::JobSpec spec;
    spec.mutable_webhook()->set_url("https://ci.example.org/");
    const std::string name = "jobs/" + std::to_string(++names_);
    EXPECT_TRUE(store_->submit({"", spec, name, 1000, {}, 0}));
    EXPECT_TRUE(store_->finish(claim(), success(), 0));
    return name;
  }
  Claim claim(const std::string& worker = "worker") { return (*store_->claim(worker))->claim; }
  static Ending success() {
    Ending ending;
    ending.state = v1::JOB_STATE_SUCCEEDED;
    ending.results.emplace_back().set_digest("result");
    return ending;
  }

  InDatabase place_;
  CuttingSocket socket_{server_folder()};
  std::unique_ptr<JobStore> store_;
  int names_ = 0;
};

TEST_F(PostgresStore, KnowsWhichJobHasWaitedLongest) {
  EXPECT_EQ(*store_->oldest_pending(), std::nullopt);
  const auto first = submit();
  submit();
  EXPECT_EQ(**store_->oldest_pending(), time_point(first->job.create_time()));
  claim();
  EXPECT_GT(**store_->oldest_pending(), time_point(first->job.create_time()));
  claim();
  EXPECT_EQ(*store_->oldest_pending(), std::nullopt);
}

// ===== the clock =====

TEST_F(PostgresStore, CountsLeasesOnTheClockOfTheDatabase) {
  reopen(milliseconds(300));
  submit();
  const Claim claimed = claim();
  EXPECT_EQ(place_
                .run("SELECT abs(lease_end / 1000 - 300000 - (extract(epoch FROM clock_timestamp()) * 1000000)::bigint)"
                     " < 10000000 FROM jobs")
                .view(0, 0),
            "t");
  EXPECT_TRUE(store_->take_back("", {})->empty());
  std::this_thread::sleep_for(milliseconds(400));
  ASSERT_TRUE(store_->renew_lease(claimed)) << "it has run out, but nobody else has the job";
  EXPECT_TRUE(store_->take_back("", {})->empty());
  std::this_thread::sleep_for(milliseconds(400));
  EXPECT_EQ(store_->take_back("", {})->size(), 1u);
}

TEST_F(PostgresStore, KnowsByTheClockOfTheDatabaseWhichCallsAreDue) {
  const std::string name = end_one_with_webhook(), newer = end_one_with_webhook();
  const auto due = [&] {
    const auto claimed = store_->claim_call(seconds(60));
    return claimed && *claimed ? (*claimed)->name() : "";
  };
  EXPECT_EQ(due(), name);
  EXPECT_EQ(due(), newer);
  EXPECT_EQ(due(), "");
  EXPECT_TRUE(store_->ended_beyond(1, std::chrono::system_clock::now() + seconds(60))->empty());
  place_.run("UPDATE jobs SET call_due = call_due - 60 * 1000000000::bigint");
  EXPECT_EQ(due(), name);
  place_.run("UPDATE jobs SET call_due = call_due - (24 * 3600 + 61) * 1000000000::bigint");
  EXPECT_EQ(store_->ended_beyond(1, std::chrono::system_clock::now() + seconds(60))->size(), 1U);
}

TEST_F(PostgresStore, TakesNoJobBackSoonAfterTheStartOfTheDatabase) {
  reopen(std::chrono::hours(24 * 365));
  submit();
  claim();
  place_.run("UPDATE jobs SET lease_end = 1");
  EXPECT_TRUE(store_->take_back("", {})->empty()) << "its worker could not renew the lease without the database";
  EXPECT_EQ(store_->take_back("worker", {})->size(), 1u) << "the worker itself has started again";
  claim();
  place_.run("UPDATE jobs SET lease_end = 1");
  reopen(milliseconds(1));
  EXPECT_EQ(store_->take_back("", {})->size(), 1u);
}

// ===== lost connections =====

TEST_F(PostgresStore, ReconnectsAfterTheDatabaseHasClosedItsConnections) {
  ASSERT_TRUE(submit());
  place_.end_connections();
  EXPECT_TRUE(store_->get("jobs/1"));
  place_.end_connections();
  EXPECT_TRUE(submit());
  EXPECT_EQ(store_->counts()->pending, 2);
}

TEST_F(PostgresStore, RepeatsATransactionThatNeverReachedTheDatabase) {
  socket_.cut(CuttingSocket::Cut::BeforeCommit);
  const auto submitted = submit();
  ASSERT_TRUE(submitted);
  EXPECT_EQ(submitted->events.size(), 1u);
  EXPECT_EQ(socket_.cuts(), 1);
  const Claim claimed = claim();
  socket_.cut(CuttingSocket::Cut::BeforeCommit);
  ASSERT_TRUE(store_->finish(claimed, success(), 0));
  EXPECT_EQ(socket_.cuts(), 2);
  EXPECT_EQ(store_->get(claimed.name)->results_size(), 1);
}

TEST_F(PostgresStore, DoesNotRepeatATransactionWhoseAnswerWasLost) {
  socket_.cut(CuttingSocket::Cut::AfterCommit);
  const auto submitted = submit();
  ASSERT_TRUE(submitted);
  EXPECT_EQ(submitted->events.size(), 1u) << "it is a new job, not a repeated request";
  EXPECT_EQ(store_->counts()->pending, 1);
  socket_.cut(CuttingSocket::Cut::AfterCommit);
  const Claim claimed = claim();
  EXPECT_EQ(claimed.attempt, 1);
  EXPECT_EQ(store_->counts()->running, 1);
  socket_.cut(CuttingSocket::Cut::AfterCommit);
  const auto finished = store_->finish(claimed, success(), 0);
  ASSERT_TRUE(finished) << "its result is not thrown away: " << finished.error().sentence;
  EXPECT_EQ(socket_.cuts(), 3);
  EXPECT_EQ(store_->get(claimed.name)->results_size(), 1);
  EXPECT_EQ(store_->events(claimed.name)->size(), 3u);
}

TEST_F(PostgresStore, AnswersUnavailableWhileTheDatabaseIsAway) {
  submit("first");
  const Claim claimed = claim();
  socket_.set_open(false);
  const auto start = std::chrono::steady_clock::now();
  const auto refused = submit("second");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Failure::Code::Unavailable);
  EXPECT_EQ(refused.error().reason, "STORE_UNAVAILABLE");
  EXPECT_GT(refused.error().retry_seconds, 0);
  EXPECT_EQ(store_->finish(claimed, success(), 0).error().reason, "STORE_UNAVAILABLE");
  EXPECT_EQ(store_->renew_lease(claimed).error().reason, "STORE_UNAVAILABLE");
  EXPECT_LT(std::chrono::steady_clock::now() - start, seconds(6)) << "later calls do not wait as long again";
  socket_.set_open(true);
  EXPECT_TRUE(store_->renew_lease(claimed));
  EXPECT_TRUE(store_->finish(claimed, success(), 0));
  EXPECT_TRUE(submit("second"));
  EXPECT_EQ(store_->list({}, 100, "")->jobs.size(), 2u);
}

TEST_F(PostgresStore, WaitsForNoOutcomeOnceTheServerStops) {
  submit();
  const Claim claimed = claim();
  socket_.cut(CuttingSocket::Cut::AfterCommitForGood);
  std::atomic<bool> answered = false;
  Answer<Changed> finished;
  std::thread worker([&] {
    finished = store_->finish(claimed, success(), 0);
    answered = true;
  });
  std::this_thread::sleep_for(seconds(7));
  EXPECT_FALSE(answered) << "a result is not thrown away because its end is not known";
  const auto begun = std::chrono::steady_clock::now();
  store_->stop_waiting();
  worker.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, seconds(6));
  EXPECT_EQ(finished.error().reason, "STORE_UNAVAILABLE");
}

TEST_F(PostgresStore, DoesNotLetARunWaitForTheDatabase) {
  submit();
  const Claim claimed = claim();
  socket_.set_open(false);
  const auto begun = std::chrono::steady_clock::now();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(store_->note_progress(claimed, {}, i).error().reason, "STORE_UNAVAILABLE");
  EXPECT_LT(std::chrono::steady_clock::now() - begun, milliseconds(1'500)) << "one that waits takes 2 s";
}

TEST_F(PostgresStore, WaitsForADatabaseThatIsAwayForAMoment) {
  submit();
  socket_.set_open(false);
  std::thread back([this] {
    std::this_thread::sleep_for(milliseconds(700));
    socket_.set_open(true);
  });
  EXPECT_TRUE(submit());
  back.join();
}

// ===== several processes =====

TEST_F(PostgresStore, IsOfOneDirectoryOfMeshes) {
  JobStoreSettings settings;
  PostgresSettings where;
  where.url = place_.url();
  settings.meshes = "one";
  EXPECT_TRUE(open_postgres_jobs(where, settings));
  EXPECT_TRUE(open_postgres_jobs(where, settings)) << "another server that shares them";
  settings.meshes = "another";
  const auto refused = open_postgres_jobs(where, settings);
  ASSERT_FALSE(refused) << "it would not find the meshes of the jobs";
  EXPECT_NE(refused.error().sentence.find("--meshes"), std::string::npos) << refused.error().sentence;
}

TEST_F(PostgresStore, GivesEachJobOfManyToOneOfSeveralStores) {
  constexpr int kJobs = 60;
  for (int i = 0; i < kJobs; ++i) submit();
  std::atomic<int> finished = 0;
  std::vector<std::thread> workers;
  for (int i = 0; i < 4; ++i)
    workers.emplace_back([&, i] {
      JobStoreSettings settings;
      settings.clock = nullptr;
      const auto store = InDatabase::open(settings, place_.url());
      while (const auto claimed = *store->claim("worker " + std::to_string(i)))
        if (store->finish(claimed->claim, success(), 0)) ++finished;
    });
  for (std::thread& worker : workers) worker.join();
  EXPECT_EQ(finished, kJobs);
  EXPECT_EQ(store_->list({{v1::JOB_STATE_SUCCEEDED}, {}}, 100, "")->jobs.size(), static_cast<std::size_t>(kJobs));
}

TEST_F(PostgresStore, KeepsTheLimitOfAPeerAmongSeveralStores) {
  JobStoreSettings settings;
  settings.clock = nullptr;
  settings.max_running_of_peer = 3;
  v1::JobSpec spec;
  for (int i = 0; i < 20; ++i)
    ASSERT_TRUE(store_->submit({"", spec, "jobs/" + std::to_string(++names_), 1000, "peer", 0}));
  std::atomic<int> claimed = 0;
  std::vector<std::thread> workers;
  for (int i = 0; i < 4; ++i)
    workers.emplace_back([&] {
      const auto store = InDatabase::open(settings, place_.url());
      while (*store->claim("worker")) ++claimed;
    });
  for (std::thread& worker : workers) worker.join();
  EXPECT_EQ(claimed, 3);
}

TEST_F(PostgresStore, LetsPeersTakeTurnsAtAllStoresTogether) {
  v1::JobSpec spec;
  const auto submit_as = [&](const std::string& peer) {
    EXPECT_TRUE(store_->submit({"", spec, "jobs/" + peer + std::to_string(++names_), 1000, peer, 0, peer}));
  };
  for (int i = 0; i < 30; ++i) submit_as("flood");
  for (int i = 0; i < 3; ++i) submit_as("ann");
  JobStoreSettings settings;
  settings.clock = nullptr;
  const auto other = InDatabase::open(settings, place_.url());
  int of_ann = 0;
  for (int i = 0; i < 6; ++i) {
    JobStore& store = i % 2 == 0 ? *store_ : *other;
    const auto claimed = *store.claim("worker");
    ASSERT_TRUE(claimed);
    if (claimed->claim.owner == "ann") ++of_ann;
    ASSERT_TRUE(store.finish(claimed->claim, success(), 0));
  }
  EXPECT_EQ(of_ann, 3) << "a flood delays each job by one";
  EXPECT_EQ(place_.run("SELECT count(*) FROM turns").number(0, 0), 2);
}

TEST_F(PostgresStore, KeepsTheTraceOfAJob) {
  v1::JobSpec spec;
  const std::string trace(32, 'a');
  ASSERT_TRUE(store_->submit({"", spec, "jobs/traced", 1000, {}, 0, {}, trace}));
  reopen(seconds(30));
  EXPECT_EQ(claim().trace, trace);
}

TEST_F(PostgresStore, KeepsACancelRequestUntilTheWorkerOfTheJobSeesIt) {
  submit();
  const Claim first = claim();
  const auto asked = store_->ask_to_cancel("jobs/1");
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->job.state(), v1::JOB_STATE_CANCELLING);
  EXPECT_TRUE(asked->events.empty()) << "only the worker knows the last number";
  EXPECT_TRUE(*store_->renew_lease(first));
  const auto seen = store_->see_cancel(first, 50);
  ASSERT_EQ(seen->events.size(), 1u);
  EXPECT_EQ(seen->events[0].sequence(), 51);
  EXPECT_TRUE(store_->see_cancel(first, 60)->events.empty()) << "once";

  submit();
  const Claim second = claim();
  ASSERT_TRUE(store_->ask_to_cancel("jobs/2"));
  Ending ending;
  ending.state = v1::JOB_STATE_CANCELLED;
  const auto finished = store_->finish(second, ending, 70);
  ASSERT_EQ(finished->events.size(), 2u) << "the run ended before its worker has seen the request";
  EXPECT_EQ(finished->events[0].state_change().state(), v1::JOB_STATE_CANCELLING);
  EXPECT_EQ(finished->events[0].sequence(), 71);
  EXPECT_EQ(store_->ask_to_cancel("jobs/2")->job.state(), v1::JOB_STATE_CANCELLED) << "too late";

  submit();
  claim();
  ASSERT_TRUE(store_->ask_to_cancel("jobs/3"));
  EXPECT_EQ(store_->take_back("worker", {})->back().job.state(), v1::JOB_STATE_CANCELLED) << "its worker was lost";
}

TEST_F(PostgresStore, SetsADamagedRowAside) {
  submit();
  submit();
  place_.run("UPDATE jobs SET job = '\\xffff' WHERE name = 'jobs/1'");
  EXPECT_EQ(store_->get("jobs/1").error().code, Failure::Code::DataLoss);
  EXPECT_EQ(store_->list({}, 100, "")->jobs.size(), 1u);
  EXPECT_FALSE(*store_->claim("worker")) << "the damaged row is found and set aside";
  EXPECT_EQ(claim().name, "jobs/2");
  EXPECT_TRUE(store_->remove("jobs/1"));
  EXPECT_EQ(store_->get("jobs/1").error().reason, "JOB_NOT_FOUND");
}

TEST_F(PostgresStore, FindsNoJobOfAnImpossibleName) {
  for (const std::string& name : {std::string("jobs/\0", 6), std::string("jobs/\xff"), std::string("1"), std::string()})
    EXPECT_EQ(store_->get(name).error().reason, "JOB_NOT_FOUND");
}

TEST_F(PostgresStore, KeepsTextsOfAnyBytes) {
  const std::string odd("a\0b", 3), other("a\0c", 3);
  v1::JobSpec spec;
  (*spec.mutable_labels())[std::string("zero\0key", 8)] = std::string("x\0", 2);
  const auto first = store_->submit({odd, spec, "jobs/1", 10, {}, 0});
  ASSERT_TRUE(first) << first.error().sentence;
  EXPECT_TRUE(store_->submit({other, spec, "jobs/2", 10, {}, 0}))
      << "another request id, though it begins like the first";
  EXPECT_EQ(store_->submit({odd, spec, "jobs/3", 10, {}, 0})->job.name(), "jobs/1");
}

}  // namespace
}  // namespace varimesh::server::testing
