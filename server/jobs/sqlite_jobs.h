// Job stores in an SQLite database, on a disk or in memory.
#pragma once

#include <memory>
#include <string>

#include "server/jobs/job_store.h"

namespace varimesh::server {

/// Opens a store whose jobs outlive the server, and creates the file if it does not exist. One process at a time may
/// use the file; state/state_directory.h ensures that. INTERNAL if it cannot be opened or was written by a newer
/// version.
Answer<std::unique_ptr<JobStore>> open_sqlite_jobs(const std::string& path, const JobStoreSettings& settings = {});

/// Whether a file has the tables of jobs. True also if it cannot be read: open_sqlite_jobs() then says why.
bool has_sqlite_jobs(const std::string& path);

/// Makes a store whose jobs are lost when the process ends.
std::unique_ptr<JobStore> jobs_in_memory(const JobStoreSettings& settings = {});

}  // namespace varimesh::server
