// Reads the address of the server, and makes schemas in its database. The program of these tests is skipped as a whole
// if there is no server.
#include "tests/server/postgres/databases.h"

#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "server/postgres/schema.h"

namespace varimesh::server::testing {

DatabaseServer database_server() {
  const char* const file = std::getenv("VARIMESH_TEST_DATABASE");
  if (file == nullptr) return {{}, "the variable VARIMESH_TEST_DATABASE, which ctest sets"};
  std::string line;
  std::getline(std::ifstream(file) >> std::ws, line);
  if (line.rfind("postgresql:", 0) == 0) return {line, {}};
  return {{}, line.empty() ? "the server that the test server.postgres.start starts" : line};
}

InDatabase::InDatabase(Tables tables) {
  static std::atomic<int> count = 0;
  name_ = "test_" + std::to_string(::getpid()) + "_" + std::to_string(++count);
  PostgresConnection(database_server().url).run("CREATE SCHEMA " + name_);
  if (tables == Tables::None) return;
  PostgresConnection connection(url());
  const auto made = migrate_postgres(connection);
  if (!made) ADD_FAILURE() << made.error().sentence;
}

InDatabase::~InDatabase() { PostgresConnection(database_server().url).run("DROP SCHEMA " + name_ + " CASCADE"); }

std::string InDatabase::url(const std::string& host) const {
  return database_server().url + "&options=-csearch_path%3D" + name_ + "&application_name=" + name_ +
         (host.empty() ? "" : "&host=" + host);
}

std::unique_ptr<JobStore> InDatabase::open(const JobStoreSettings& settings, const std::string& url) {
  PostgresSettings where;
  where.url = url;
  where.patience = std::chrono::milliseconds(2'000);
  auto store = open_postgres_jobs(where, settings);
  if (!store) ADD_FAILURE() << store.error().sentence;
  return store ? std::move(*store) : nullptr;
}

PostgresRows InDatabase::run(const std::string& statements) { return PostgresConnection(url()).run(statements); }

void InDatabase::end_connections() {
  PostgresConnection(database_server().url)
      .run("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = '" + name_ + "'");
}

}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  const std::string missing = varimesh::server::testing::database_server().missing;
  if (missing.empty() || ::testing::GTEST_FLAG(list_tests)) return RUN_ALL_TESTS();
  std::fprintf(stderr, "SKIPPED: the tests of PostgreSQL do not run here; %s\n", missing.c_str());
  return 77;
}
