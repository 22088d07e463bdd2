// The tables in which SqliteJobStore keeps jobs.
#pragma once

#include "server/jobs/sqlite.h"

namespace varimesh::server {

/// Sets the connection up to write, and makes the tables where there are none. False where a newer version made them.
bool set_up_schema(SqliteDatabase& database);

}  // namespace varimesh::server
