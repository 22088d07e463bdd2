// The tables of a job store in SQLite.
#pragma once

#include "server/jobs/sqlite.h"

namespace varimesh::server {

/// Configures the connection for writing, and creates the tables or updates them. Returns false if a newer version made
/// the tables.
bool set_up_schema(SqliteDatabase& database);

}  // namespace varimesh::server
