// The tables of jobs in a PostgreSQL database, which many servers can share.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/jobs/job_store.h"

namespace varimesh::server {

/// What a job store in PostgreSQL needs besides the settings of every store.
struct PostgresSettings {
  std::string url;
  int connections = 8;                        ///< At most, at a time.
  std::chrono::milliseconds patience{5'000};  ///< How long a call waits for a database that cannot be reached.
  std::function<void(const std::string& line)> log = [](const auto&) {};
};

/// Opens the store. Its leases are on the database's clock; a clock in the settings replaces it, for tests. UNAVAILABLE
/// if the database cannot be reached; INTERNAL if `varimeshd migrate` has not made its tables, if a newer version has,
/// or if its jobs have their meshes in another directory.
Answer<std::unique_ptr<JobStore>> open_postgres_jobs(const PostgresSettings& where,
                                                     const JobStoreSettings& settings = {});

/// The texts of notifications: that a job waits, that a job is to be cancelled, and that it has new events; its name
/// follows.
inline constexpr char kQueueNews[] = "queue", kCancelNews[] = "cancel ", kChangedNews[] = "changed ";

}  // namespace varimesh::server
