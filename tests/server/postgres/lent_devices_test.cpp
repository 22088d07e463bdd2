// What the servers of a database tell each other of their devices, and who takes the jobs that need one.
#include <gtest/gtest.h>

#include "tests/server/postgres/databases.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::seconds;

/// A store with a clock that the test controls.
class Lent : public ::testing::Test {
 protected:
  Lent() {
    JobStoreSettings settings;
    settings.clock = [this] { return now_; };
    settings.lease = seconds(30);
    store_ = InDatabase::open(settings, place_.url());
  }

  std::string submit(bool needs_device) {
    const std::string name = "jobs/" + std::to_string(++names_);
    EXPECT_TRUE(store_->submit({"", {}, name, 1000, {}, 0, {}, {}, needs_device}));
    return name;
  }
  /// The devices of all servers, those that jobs have, the jobs, and the cards.
  std::string lent() {
    const LentDevices all = *store_->lent_devices();
    return std::to_string(all.devices) + " " + std::to_string(all.busy) + " " + std::to_string(all.jobs) + " " +
           all.names;
  }
  /// The names of the jobs that are told that no device is there.
  std::vector<std::string> told() {
    std::vector<std::string> names;
    const auto told = store_->tell_of_missing_devices();
    for (const Changed& changed : *told) names.push_back(changed.job.name());
    return names;
  }

  InDatabase place_;
  TimePoint now_ = TimePoint(std::chrono::hours(400'000));
  std::unique_ptr<JobStore> store_;
  int names_ = 0;
};

TEST_F(Lent, DevicesCountForOneLease) {
  EXPECT_EQ(lent(), "0 0 0 ");
  ASSERT_TRUE(store_->note_devices("one", {2, 1, 1, "H200, T4"}));
  now_ += seconds(20);
  ASSERT_TRUE(store_->note_devices("two", {1, 1, 3, "T4"}));
  EXPECT_EQ(lent(), "3 2 4 H200, T4");
  ASSERT_TRUE(store_->note_devices("two", {1, 0, 0, "T4"}));
  EXPECT_EQ(lent(), "3 1 1 H200, T4") << "the newest counts";
  now_ += seconds(10);
  EXPECT_EQ(lent(), "1 0 0 T4") << "the first server is lost";
  ASSERT_TRUE(store_->note_devices("two", {}));
  EXPECT_EQ(lent(), "0 0 0 ") << "the second has ended";
  EXPECT_EQ(place_.run("SELECT count(*) FROM lent_devices").number(0, 0), 0) << "and nothing is left";
}

TEST_F(Lent, JobsAreToldOnceThatNoDeviceIsThere) {
  submit(false);
  EXPECT_EQ(told(), std::vector<std::string>{});
  const std::string job = submit(true);
  EXPECT_EQ(told(), std::vector{job});
  EXPECT_EQ(told(), std::vector<std::string>{});
  const auto events = *store_->events(job);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_NE(events[1].log().text().find("no server that runs now has one"), std::string::npos)
      << events[1].log().text();
  EXPECT_EQ(events[1].sequence(), 2);
  EXPECT_EQ(store_->get(job)->state(), v1::JOB_STATE_PENDING);
  ASSERT_TRUE(store_->note_devices("one", {1, 0, 0, "T4"}));
  EXPECT_EQ((*store_->claim("any", {.needs_no_device = true}))->claim.name, "jobs/1");
  EXPECT_FALSE(*store_->claim("any", {.needs_no_device = true})) << "who was told needs a device as before";
  const auto claimed = *store_->claim("one");
  ASSERT_TRUE(claimed);
  EXPECT_EQ(claimed->claim.name, job);
  EXPECT_EQ(claimed->events[0].sequence(), 3);
}

TEST_F(Lent, JobsAreNotToldWhileADeviceIsThere) {
  ASSERT_TRUE(store_->note_devices("one", {1, 1, 1, "T4"}));
  const std::string job = submit(true);
  EXPECT_EQ(told(), std::vector<std::string>{}) << "it waits for one that another job has";
  now_ += seconds(30);
  EXPECT_EQ(told(), std::vector{job}) << "the server is lost";
}

TEST_F(Lent, ManyJobsThatWaitForOneHoldNobodyUp) {
  for (int i = 0; i < 300; ++i) submit(true);
  const std::string job = submit(false);
  const PostgresRows rows = place_.run(
      "ANALYZE jobs; SET enable_seqscan = off; EXPLAIN SELECT key FROM jobs WHERE state = 1 AND needs_device = 0 AND "
      "peer = '' ORDER BY turn, key LIMIT 1");
  std::string plan;
  for (int row = 0; row < rows.count(); ++row) plan += rows.text(row, 0) + "\n";
  EXPECT_NE(plan.find("jobs_waiting_anywhere"), std::string::npos) << plan;
  EXPECT_EQ((*store_->claim("any", {.needs_no_device = true}))->claim.name, job);
}

}  // namespace
}  // namespace varimesh::server::testing
