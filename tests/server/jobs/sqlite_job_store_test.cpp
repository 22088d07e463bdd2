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

TEST(SqliteJobStore, UpdatesOldTables) {
  InFile place;
  const JobStoreSettings settings;
  ASSERT_TRUE(place.open(settings)->submit({"id", {}, "jobs/old", 10, {}, 0}));
  {
    SqliteDatabase database((place.directory() / "jobs.sqlite").string());
    database.run(
        "DROP INDEX jobs_waiting_of; ALTER TABLE jobs DROP COLUMN owner; ALTER TABLE jobs DROP COLUMN furthest; "
        "PRAGMA user_version = 1");
  }
  const auto store = place.open(settings);
  ASSERT_TRUE(store->get("jobs/old"));
  EXPECT_TRUE(*store->claim("worker"));
}

}  // namespace
}  // namespace varimesh::server::testing
