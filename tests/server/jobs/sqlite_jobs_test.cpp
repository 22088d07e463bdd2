// The files of job stores in SQLite: those that it refuses, and those of older versions.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "server/jobs/sqlite.h"
#include "tests/server/jobs/job_stores.h"

namespace varimesh::server::testing {
namespace {

TEST(SqliteJobs, RefusesMissingFoldersAndNewerTables) {
  InFile place;
  const std::string path = (place.directory() / "jobs.sqlite").string();
  EXPECT_FALSE(open_sqlite_jobs((place.directory() / "none" / "jobs.sqlite").string()));
  {
    SqliteDatabase database(path);
    database.run("PRAGMA user_version = 99");
  }
  const auto newer = open_sqlite_jobs(path);
  ASSERT_FALSE(newer);
  EXPECT_NE(newer.error().sentence.find("newer version"), std::string::npos) << newer.error().sentence;
}

TEST(SqliteJobs, FollowsNoLinks) {
  InFile place;
  { const auto store = place.open({}); }
  std::filesystem::rename(place.directory() / "jobs.sqlite", place.directory() / "elsewhere");
  std::filesystem::create_symlink(place.directory() / "elsewhere", place.directory() / "jobs.sqlite");
  EXPECT_FALSE(open_sqlite_jobs((place.directory() / "jobs.sqlite").string()));
}

TEST(SqliteJobs, KeepsItsRoomAlsoAfterARestart) {
  InFile place;
  const std::string path = (place.directory() / "jobs.sqlite-room").string();
  const auto kept = [&] {
    { const auto store = place.open({}); }
    struct stat file {};
    EXPECT_EQ(::stat(path.c_str(), &file), 0);
    return static_cast<std::int64_t>(file.st_blocks) * 512;
  };
  constexpr std::int64_t kRoom = std::int64_t{4} << 20;
  EXPECT_GE(kept(), kRoom);
  for (const off_t left : {off_t{0}, off_t{100'000}, off_t{4} << 20}) {  // spent; spent in part; a copy with a hole
    std::filesystem::remove(path);
    std::ofstream(path).flush();
    std::filesystem::resize_file(path, static_cast<std::uintmax_t>(left));
    EXPECT_GE(kept(), kRoom) << left;
  }
}

TEST(SqliteJobs, RefusesFlippedBits) {
  const JobStoreSettings settings;
  const char* blobs[][2] = {{"jobs", "job"}, {"specs", "spec"}, {"events", "event"}};
  int flips = 0;
  for (const auto& [table, column] : blobs) {
    for (int byte = 0;; ++byte) {
      InFile place;
      Submission submission{"id", {}, "jobs/damaged", 10, {}, 0};
      (*submission.spec.mutable_labels())["name"] = "a label";
      ASSERT_TRUE(place.open(settings)->submit(submission));
      {
        SqliteDatabase database((place.directory() / "jobs.sqlite").string());
        std::string bytes;
        {
          auto query = database.query(std::string("SELECT ") + column + " FROM " + table);
          query.step();
          bytes = query.text(0);
        }
        if (byte >= static_cast<int>(bytes.size())) break;  // times have different lengths
        bytes[static_cast<std::size_t>(byte)] ^= static_cast<char>(1 << (byte % 8));
        database.query(std::string("UPDATE ") + table + " SET " + column + " = ?").bind(SqliteBytes{bytes}).run();
      }
      ++flips;
      const auto store = place.open(settings);
      ASSERT_TRUE(store->submit({"", {}, "jobs/good", 10, {}, 0}));
      if (std::string(table) == "events") {
        EXPECT_EQ(store->events("jobs/damaged").error().code, Failure::Code::DataLoss) << byte;
        continue;
      }
      EXPECT_EQ(store->get("jobs/damaged").error().code, Failure::Code::DataLoss) << table << byte;
      EXPECT_EQ(store->list({}, 10, "")->jobs.size(), 1u) << "the list has the others";
      EXPECT_FALSE(*store->claim("worker")) << "it is set aside";
      const auto claimed = *store->claim("worker");
      ASSERT_TRUE(claimed) << "the job behind it is not held up";
      EXPECT_EQ(claimed->claim.name, "jobs/good");
      EXPECT_TRUE(store->remove("jobs/damaged"));
      EXPECT_EQ(store->get("jobs/damaged").error().code, Failure::Code::NotFound);
    }
  }
  EXPECT_GT(flips, 60);
}

TEST(SqliteJobs, RefusesRowsWithChangedNumbers) {
  const JobStoreSettings settings;
  for (const char* change : {"state = 3", "token = 9", "lost = 1", "worker = 'other'", "lease_end = 7", "history = 'h'",
                             "checkpoint = 'c'", "furthest = 5", "owner = 'bob'"}) {
    InFile place;
    ASSERT_TRUE(place.open(settings)->submit({"id", {}, "jobs/damaged", 10, {}, 0}));
    SqliteDatabase((place.directory() / "jobs.sqlite").string())
        .run((std::string("UPDATE jobs SET ") + change).c_str());
    const auto store = place.open(settings);
    EXPECT_EQ(store->get("jobs/damaged").error().code, Failure::Code::DataLoss) << change;
    EXPECT_TRUE(store->take_back("worker", {})) << change;
    EXPECT_FALSE(*store->claim("worker")) << change;
    EXPECT_TRUE(store->references());
  }
}

/// Gives the file the tables of version 4, which had an owner only for the limits per peer.
constexpr char kBackTo4[] = R"(
CREATE TABLE jobs_4(key INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL UNIQUE, request_id TEXT UNIQUE,
  state INTEGER NOT NULL, turn INTEGER NOT NULL, ended INTEGER, token INTEGER NOT NULL, lost INTEGER NOT NULL,
  worker TEXT NOT NULL, lease_end INTEGER NOT NULL, history TEXT NOT NULL, checkpoint TEXT,
  checkpoint_iteration INTEGER NOT NULL, job BLOB NOT NULL, furthest INTEGER NOT NULL DEFAULT 0,
  owner TEXT NOT NULL DEFAULT '', sum INTEGER NOT NULL DEFAULT 0);
INSERT INTO jobs_4 SELECT key, name, request_id, state, turn, ended, token, lost, worker, lease_end, history, checkpoint,
  checkpoint_iteration, job, furthest, peer, sum FROM jobs;
UPDATE sqlite_sequence SET seq = (SELECT seq FROM sqlite_sequence WHERE name = 'jobs') WHERE name = 'jobs_4';
DROP TABLE jobs;
ALTER TABLE jobs_4 RENAME TO jobs;
CREATE INDEX jobs_waiting ON jobs(turn, key) WHERE state = 1;
CREATE INDEX jobs_waiting_of ON jobs(owner) WHERE state = 1;
CREATE INDEX jobs_running ON jobs(key) WHERE worker <> '';
CREATE INDEX jobs_ended ON jobs(ended, key) WHERE ended IS NOT NULL;
PRAGMA user_version = 4;
)";
constexpr char kBackTo1[] = R"(
ALTER TABLE jobs DROP COLUMN sum;
ALTER TABLE specs DROP COLUMN sum;
ALTER TABLE events DROP COLUMN sum;
DROP INDEX jobs_waiting_of;
ALTER TABLE jobs DROP COLUMN owner;
ALTER TABLE jobs DROP COLUMN furthest;
PRAGMA user_version = 1;
)";

TEST(SqliteJobs, UpdatesOldTables) {
  JobStoreSettings settings;
  settings.max_running_of_peer = 1;
  for (const int version : {4, 1}) {
    InFile place;
    {
      const auto store = place.open(settings);
      for (const char* name : {"jobs/old", "jobs/next", "jobs/newest"})
        ASSERT_TRUE(store->submit({std::string("id of ") + name, {}, name, 10, "10.0.0.7", 0}));
      ASSERT_TRUE(store->request_cancel("jobs/newest", 0));
      ASSERT_TRUE(store->remove("jobs/newest"));
    }
    {
      SqliteDatabase database((place.directory() / "jobs.sqlite").string());
      database.run(kBackTo4);
      if (version == 1) database.run(kBackTo1);
    }
    const auto store = place.open(settings);
    ASSERT_TRUE(store->get("jobs/old")) << version;
    EXPECT_EQ(store->get("jobs/old")->owner(), "");
    EXPECT_EQ(store->events("jobs/old")->size(), 1u);
    EXPECT_EQ(store->submit({"id of jobs/old", {}, "jobs/again", 10, {}, 0})->job.name(), "jobs/old");
    EXPECT_FALSE(store->submit({"id of jobs/old", {}, "jobs/other", 10, {}, 0, "bob"})->events.empty());
    SqliteDatabase database((place.directory() / "jobs.sqlite").string());
    auto newest = database.query("SELECT key FROM jobs WHERE name = 'jobs/other'");
    ASSERT_TRUE(newest.step());
    EXPECT_EQ(newest.number(0), 4) << "the key of the job that was deleted is not used again";
    std::set<std::string> claimed;
    while (const auto next = *store->claim("worker")) claimed.insert(next->claim.name);
    std::set<std::string> expected{"jobs/old", "jobs/other"};
    if (version == 1) expected.insert("jobs/next");
    EXPECT_EQ(claimed, expected) << "version 4 knows the peers, and one job of each may run";
  }
}

TEST(SqliteJobs, UpdatesTablesThatKnowNoDevices) {
  InFile place;
  ASSERT_TRUE(place.open({})->submit({"", {}, "jobs/old", 10, {}, 0}));
  SqliteDatabase((place.directory() / "jobs.sqlite").string())
      .run("DROP INDEX jobs_waiting_anywhere; ALTER TABLE jobs DROP COLUMN needs_device; PRAGMA user_version = 7;");
  const auto store = place.open({});
  ASSERT_TRUE(store->submit({"", {}, "jobs/new", 10, {}, 0, {}, {}, true}));
  std::set<std::string> claimed;
  while (const auto next = *store->claim("worker", {.needs_no_device = true})) claimed.insert(next->claim.name);
  EXPECT_EQ(claimed, std::set<std::string>{"jobs/old"}) << "it was submitted when every server took it";
  EXPECT_EQ((*store->claim("worker"))->claim.name, "jobs/new");
}

}  // namespace
}  // namespace varimesh::server::testing
