// The tables of a job store in PostgreSQL, and the numbered steps that make them.
#pragma once

#include "server/failure.h"
#include "server/postgres/connection.h"

namespace varimesh::server {

/// The version of the tables that this program works with.
extern const int kPostgresVersion;

/// Returns the version of the tables in the database. 0: there are none.
int postgres_version(PostgresConnection& connection);

/// Makes the tables or updates them, in one transaction. Returns the version before. Two programs may do this at the
/// same time. INTERNAL if a newer version made the tables.
Answer<int> migrate_postgres(PostgresConnection& connection);

/// The tables of a database have this version, which is newer than this program.
Refusal postgres_too_new(int version);

}  // namespace varimesh::server
