// A schema of its own in the database of the tests, for each test.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/postgres/connection.h"
#include "server/postgres/postgres_jobs.h"
#include "tests/server/jobs/job_store_conformance.h"

namespace varimesh::server::testing {

/// The address of the database server of the tests, and why there is none if it is empty.
struct DatabaseServer {
  std::string url, missing;
};
DatabaseServer database_server();

/// A place for a store, with tables, which are deleted at the end.
class InDatabase : public StorePlace {
 public:
  enum class Tables { Made, None };
  explicit InDatabase(Tables tables = Tables::Made);
  ~InDatabase() override;
  std::unique_ptr<JobStore> open(const JobStoreSettings& settings) override { return open(settings, url()); }
  static std::unique_ptr<JobStore> open(const JobStoreSettings& settings, const std::string& url);

  /// The address. `host`: the folder of the socket, if it is not the server's own.
  std::string url(const std::string& host = {}) const;
  /// Runs statements in this place, with a connection of their own.
  PostgresRows run(const std::string& statements);
  /// Closes all connections to this place from the side of the database.
  void end_connections();

 private:
  std::string name_;
};

}  // namespace varimesh::server::testing
