// Tests of the tables and their versions, and of the address.
#include "server/postgres/schema.h"

#include <gtest/gtest.h>

#include <thread>

#include "server/postgres/database.h"
#include "tests/server/postgres/databases.h"

namespace varimesh::server::testing {
namespace {

PostgresSettings at(const InDatabase& place) {
  PostgresSettings where;
  where.url = place.url();
  return where;
}

TEST(PostgresSchema, IsMadeOnceAndThenLeftAlone) {
  InDatabase place(InDatabase::Tables::None);
  const auto first = migrate_postgres(place.url());
  ASSERT_TRUE(first) << first.error().sentence;
  EXPECT_NE(first->find("Made the tables"), std::string::npos) << *first;
  auto store = InDatabase::open({}, place.url());
  ASSERT_TRUE(store->submit({"", {}, "jobs/1", 10, {}, 0}));
  const auto second = migrate_postgres(place.url());
  ASSERT_TRUE(second) << second.error().sentence;
  EXPECT_NE(second->find("already"), std::string::npos) << *second;
  EXPECT_TRUE(store->get("jobs/1"));
}

TEST(PostgresSchema, IsUpdatedFromVersion1) {
  InDatabase place;
  auto store = InDatabase::open({}, place.url());
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(std::string(64, 'a'));
  spec.mutable_geometry()->set_digest(std::string(64, 'c'));
  ASSERT_TRUE(store->submit({"id", spec, "jobs/old", 10, {}, 0}));
  store.reset();
  place.run(
      "DROP FUNCTION note_mesh, note_needs, digests_in CASCADE; DROP TABLE needs; DROP TABLE meshes; "
      "DROP TABLE turns; DROP SEQUENCE turn_numbers; DROP INDEX jobs_waiting, jobs_waiting_of, jobs_running, "
      "jobs_ended_of; CREATE INDEX jobs_waiting ON jobs(turn, key) WHERE state = 1; CREATE INDEX jobs_waiting_of ON "
      "jobs(peer) WHERE state = 1; CREATE INDEX jobs_running ON jobs(key) WHERE worker <> ''; CREATE INDEX jobs_ended "
      "ON "
      "jobs(ended, key) WHERE ended IS NOT NULL; "
      "ALTER TABLE jobs DROP COLUMN cancel_unseen, DROP COLUMN trace, DROP COLUMN call_due, DROP COLUMN needs_device; "
      "DROP TABLE lent_devices; DELETE FROM varimesh_schema WHERE version > 1");
  const auto refused = open_postgres_jobs(at(place));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("varimeshd migrate"), std::string::npos) << refused.error().sentence;
  const auto updated = migrate_postgres(place.url());
  ASSERT_TRUE(updated) << updated.error().sentence;
  EXPECT_NE(updated->find("from version 1"), std::string::npos) << *updated;
  store = InDatabase::open({}, place.url());
  EXPECT_EQ(store->submit({"id", spec, "jobs/new", 10, {}, 0})->job.name(), "jobs/old");
  const std::string mesh(64, 'a'), other(64, 'b'), geometry(64, 'c');
  EXPECT_EQ(*store->referenced({mesh, other, geometry}), (std::set{mesh, geometry}))
      << "the needs of the jobs that were there";
  EXPECT_TRUE(*store->claim("worker"));
}

TEST(PostgresSchema, IsUpdatedWhileServersWithoutDevicesRun) {
  InDatabase place;
  auto store = InDatabase::open({}, place.url());
  ASSERT_TRUE(store->submit({"", {}, "jobs/old", 10, {}, 0}));
  store.reset();
  place.run(
      "ALTER TABLE jobs DROP COLUMN needs_device; DROP TABLE lent_devices; "
      "DELETE FROM varimesh_schema WHERE version > 7");
  ASSERT_TRUE(migrate_postgres(place.url()));
  // As a server of version 7 does it.
  place.run(
      "INSERT INTO jobs(name, owner, peer, trace, turn, state, token, lost, furthest, worker, lease_end, history, "
      "checkpoint_iteration, job) SELECT 'jobs/as-before', owner, peer, trace, turn, state, token, lost, furthest, "
      "worker, lease_end, history, checkpoint_iteration, job FROM jobs; INSERT INTO specs SELECT max(key), '' FROM "
      "jobs");
  store = InDatabase::open({}, place.url());
  int claimed = 0;
  while (*store->claim("worker", {.needs_no_device = true})) ++claimed;
  EXPECT_EQ(claimed, 2) << "every server takes them";
}

TEST(PostgresSchema, IsMadeByTwoProgramsAtTheSameTime) {
  InDatabase place(InDatabase::Tables::None);
  std::vector<std::thread> programs;
  for (int i = 0; i < 4; ++i)
    programs.emplace_back([&] {
      const auto made = migrate_postgres(place.url());
      EXPECT_TRUE(made) << made.error().sentence;
    });
  for (std::thread& program : programs) program.join();
  EXPECT_EQ(place.run("SELECT count(*) FROM varimesh_schema").number(0, 0), kPostgresVersion);
}

TEST(PostgresSchema, HasToBeMadeBeforeTheStoreIsOpened) {
  InDatabase place(InDatabase::Tables::None);
  const auto store = open_postgres_jobs(at(place));
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().sentence.find("varimeshd migrate"), std::string::npos) << store.error().sentence;
}

TEST(PostgresSchema, OfANewerVersionIsRefused) {
  InDatabase place;
  place.run("INSERT INTO varimesh_schema(version) VALUES(99)");
  const auto store = open_postgres_jobs(at(place));
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().sentence.find("99"), std::string::npos) << store.error().sentence;
  const auto migrated = migrate_postgres(place.url());
  ASSERT_FALSE(migrated);
  EXPECT_NE(migrated.error().sentence.find("newer varimeshd"), std::string::npos) << migrated.error().sentence;
}

TEST(PostgresAddress, IsRefusedWithAPassword) {
  EXPECT_TRUE(check_postgres("postgresql://farm@host:5433/jobs?sslmode=verify-full"));
  EXPECT_TRUE(check_postgres("postgres:///jobs?host=/run/postgresql"));
  for (const char* address :
       {"postgresql://farm:secret@host/jobs", "postgresql://host/jobs?password=secret",
        "postgresql://host/jobs?sslpassword=secret", "mysql://host/jobs", "jobs", "postgresql://[host"}) {
    const auto checked = check_postgres(address);
    ASSERT_FALSE(checked) << address;
    EXPECT_EQ(checked.error().kind, Error::Kind::BadOption);
    EXPECT_EQ(checked.error().sentence.find("secret"), std::string::npos) << checked.error().sentence;
  }
}

TEST(PostgresAddress, OfAnotherMachineSaysWhetherToEncrypt) {
  for (const char* mode : {"disable", "prefer", "require", "verify-full"})
    EXPECT_TRUE(check_postgres(std::string("postgresql://farm@db.example/jobs?sslmode=") + mode)) << mode;
  for (const char* address : {"postgresql:///jobs", "postgresql://localhost/jobs", "postgresql://127.0.0.1:5433/jobs",
                              "postgresql://[::1]/jobs", "postgresql:///jobs?host=/run/postgresql,localhost"})
    EXPECT_TRUE(check_postgres(address)) << address;
  const auto refused = {"postgresql://db.example/jobs", "postgresql:///jobs?hostaddr=192.0.2.1",
                        "postgresql:///jobs?host=/run/postgresql,db.example", "postgresql://localhost.example/jobs"};
  for (const char* address : refused) {
    const auto checked = check_postgres(address);
    ASSERT_FALSE(checked) << address;
    EXPECT_NE(checked.error().sentence.find("sslmode"), std::string::npos) << checked.error().sentence;
  }
  ::setenv("PGHOST", "db.example", 1);
  EXPECT_FALSE(check_postgres("postgresql:///jobs"));
  ::setenv("PGSSLMODE", "require", 1);
  for (const char* address : refused) EXPECT_TRUE(check_postgres(address)) << address;
  ::unsetenv("PGSSLMODE");
  ::unsetenv("PGHOST");
}

TEST(PostgresAddress, ThatNobodyAnswersIsReported) {
  const auto store = open_postgres("postgresql:///jobs?host=/tmp/there-is-no-such-folder", {}, [](const auto&) {});
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().kind, Error::Kind::Output);
  EXPECT_NE(store.error().sentence.find("there-is-no-such-folder"), std::string::npos) << store.error().sentence;
}

}  // namespace
}  // namespace varimesh::server::testing
