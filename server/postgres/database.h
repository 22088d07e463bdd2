// Opens the job store in PostgreSQL. The one header of this room that others use; it needs no libpq.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/jobs/job_store.h"

namespace varimesh::server {

/// Whether this is the address of a PostgreSQL database: postgresql://… or postgres://….
bool is_postgres(const std::string& address);

/// BadOption if the address cannot be read or has a password, if it is of another machine and leaves open whether to
/// encrypt (sslmode), or without libpq.
Expected<void> check_postgres(const std::string& address);

/// Opens the job store. Requires that check_postgres() has accepted the address. Output if the database cannot be
/// reached, or its tables are not of this version. `log` is told when the database is lost, and when it is back.
Expected<std::unique_ptr<JobStore>> open_postgres(const std::string& address, const JobStoreSettings& settings,
                                                  std::function<void(const std::string& line)> log);

/// Makes the tables of the job store, or updates them, and returns a sentence about it. Errors as of open_postgres().
Expected<std::string> migrate_postgres(const std::string& address);

}  // namespace varimesh::server
