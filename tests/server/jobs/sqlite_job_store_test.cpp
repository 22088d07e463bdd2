// The files of SqliteJobStore: those that it refuses, and those of older versions.
#include <gtest/gtest.h>

#include "tests/server/jobs/job_stores.h"

namespace varimesh::server::testing {
namespace {

TEST(SqliteJobStore, RefusesMissingFoldersAndNewerTables) {
  InFile place;
  const std::string path = (place.directory() / "jobs.sqlite").string();
  EXPECT_FALSE(SqliteJobStore::open((place.directory() / "none" / "jobs.sqlite").string()));
  {
    SqliteDatabase database(path);
    database.run("PRAGMA user_version = 99");
  }
  const auto newer = SqliteJobStore::open(path);
  ASSERT_FALSE(newer);
  EXPECT_NE(newer.error().sentence.find("newer version"), std::string::npos) << newer.error().sentence;
}

TEST(SqliteJobStore, FollowsNoLinks) {
  InFile place;
  { const auto store = place.open({}); }
  std::filesystem::rename(place.directory() / "jobs.sqlite", place.directory() / "elsewhere");
  std::filesystem::create_symlink(place.directory() / "elsewhere", place.directory() / "jobs.sqlite");
  EXPECT_FALSE(SqliteJobStore::open((place.directory() / "jobs.sqlite").string()));
}

TEST(SqliteJobStore, RefusesFlippedBits) {
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

TEST(SqliteJobStore, RefusesRowsWithChangedNumbers) {
  const JobStoreSettings settings;
  for (const char* change : {"state = 3", "token = 9", "lost = 1", "worker = 'other'", "lease_end = 7", "history = 'h'",
                             "checkpoint = 'c'", "furthest = 5"}) {
    InFile place;
    ASSERT_TRUE(place.open(settings)->submit({"id", {}, "jobs/damaged", 10, {}, 0}));
    SqliteDatabase((place.directory() / "jobs.sqlite").string())
        .run((std::string("UPDATE jobs SET ") + change).c_str());
    const auto store = place.open(settings);
    EXPECT_EQ(store->get("jobs/damaged").error().code, Failure::Code::DataLoss) << change;
    EXPECT_TRUE(store->take_back("worker", {})) << change;
    EXPECT_FALSE(*store->claim("worker")) << change;
    EXPECT_TRUE(store->digests());
  }
}

TEST(SqliteJobStore, UpdatesOldTables) {
  InFile place;
  const JobStoreSettings settings;
  ASSERT_TRUE(place.open(settings)->submit({"id", {}, "jobs/old", 10, {}, 0}));
  {
    SqliteDatabase database((place.directory() / "jobs.sqlite").string());
    database.run(
        "ALTER TABLE jobs DROP COLUMN sum; ALTER TABLE specs DROP COLUMN sum; ALTER TABLE events DROP COLUMN sum; "
        "DROP INDEX jobs_waiting_of; ALTER TABLE jobs DROP COLUMN owner; ALTER TABLE jobs DROP COLUMN furthest; "
        "PRAGMA user_version = 1");
  }
  const auto store = place.open(settings);
  ASSERT_TRUE(store->get("jobs/old"));
  EXPECT_EQ(store->events("jobs/old")->size(), 1u);
  EXPECT_TRUE(*store->claim("worker"));
}

}  // namespace
}  // namespace varimesh::server::testing
