// The tables and their versions.
#include "server/jobs/sqlite_schema.h"

#include "server/jobs/job_rows.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {
namespace {

/// The version of the tables below. A change of the tables gets a new version and a step that updates older tables.
constexpr int kVersion = 8;

// The spec never changes and may be large. It has a table of its own, so that it is not written with every change of a
// job.
constexpr char kSchema[] = R"(
CREATE TABLE jobs(
  key INTEGER PRIMARY KEY AUTOINCREMENT,  -- in the order of submission
  name TEXT NOT NULL UNIQUE,
  request_id TEXT UNIQUE,                 -- NULL: none
  state INTEGER NOT NULL,                 -- v1.JobState
  turn INTEGER NOT NULL,                  -- place in the queue, smallest first, in milliseconds
  ended INTEGER,                          -- time of the end, in nanoseconds since 1970; NULL: not yet
  token INTEGER NOT NULL,                 -- of the newest claim
  lost INTEGER NOT NULL,                  -- attempts that were lost with their worker since the last progress
  worker TEXT NOT NULL,                   -- empty: none
  lease_end INTEGER NOT NULL,             -- in nanoseconds since 1970
  history TEXT NOT NULL,                  -- digest; empty: none
  checkpoint TEXT,                        -- digest; NULL: none
  checkpoint_iteration INTEGER NOT NULL,
  job BLOB NOT NULL                       -- v1.Job without its spec
);
CREATE INDEX jobs_waiting ON jobs(turn, key) WHERE state = 1;
CREATE INDEX jobs_running ON jobs(key) WHERE worker <> '';
CREATE INDEX jobs_ended ON jobs(ended, key) WHERE ended IS NOT NULL;
CREATE TABLE specs(key INTEGER PRIMARY KEY REFERENCES jobs, spec BLOB NOT NULL);  -- v1.JobSpec
CREATE TABLE labels(name TEXT NOT NULL, value TEXT NOT NULL, key INTEGER NOT NULL REFERENCES jobs,
  PRIMARY KEY(name, value, key)) WITHOUT ROWID;
CREATE INDEX labels_of ON labels(key);
CREATE TABLE events(key INTEGER NOT NULL REFERENCES jobs, sequence INTEGER NOT NULL, event BLOB NOT NULL,  -- v1.JobEvent
  PRIMARY KEY(key, sequence)) WITHOUT ROWID;
PRAGMA user_version = 1;
)";

constexpr char kToVersion2[] = R"(
ALTER TABLE jobs ADD COLUMN furthest INTEGER NOT NULL DEFAULT 0;  -- last iteration that any attempt has reached
PRAGMA user_version = 2;
)";
constexpr char kToVersion3[] = R"(
ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';  -- of the job; empty: unknown
CREATE INDEX jobs_waiting_of ON jobs(owner) WHERE state = 1;
PRAGMA user_version = 3;
)";
constexpr char kToVersion4[] = R"(
ALTER TABLE jobs ADD COLUMN sum INTEGER NOT NULL DEFAULT 0;    -- check sum of the row
ALTER TABLE specs ADD COLUMN sum INTEGER NOT NULL DEFAULT 0;   -- check sum of the row
ALTER TABLE events ADD COLUMN sum INTEGER NOT NULL DEFAULT 0;  -- check sum of the row
PRAGMA user_version = 4;
)";
// Each owner has request ids of its own, and SQLite can only change a constraint by making the table again. What was
// called the owner until now is the peer. AUTOINCREMENT goes on where it was, so that keys are never used again.
constexpr char kToVersion5[] = R"(
CREATE TABLE jobs_5(
  key INTEGER PRIMARY KEY AUTOINCREMENT,  -- in the order of submission
  name TEXT NOT NULL UNIQUE,
  owner TEXT NOT NULL,                    -- whose job it is; empty: nobody's
  request_id TEXT,                        -- NULL: none
  peer TEXT NOT NULL,                     -- who the limits per peer count; empty: unknown
  state INTEGER NOT NULL,                 -- v1.JobState
  turn INTEGER NOT NULL,                  -- place in the queue, smallest first, in milliseconds
  ended INTEGER,                          -- time of the end, in nanoseconds since 1970; NULL: not yet
  token INTEGER NOT NULL,                 -- of the newest claim
  lost INTEGER NOT NULL,                  -- attempts that were lost with their worker since the last progress
  worker TEXT NOT NULL,                   -- empty: none
  lease_end INTEGER NOT NULL,             -- in nanoseconds since 1970
  history TEXT NOT NULL,                  -- digest; empty: none
  checkpoint TEXT,                        -- digest; NULL: none
  checkpoint_iteration INTEGER NOT NULL,
  job BLOB NOT NULL,                      -- v1.Job without its spec
  furthest INTEGER NOT NULL DEFAULT 0,    -- last iteration that any attempt has reached
  sum INTEGER NOT NULL DEFAULT 0,         -- check sum of the row
  UNIQUE(owner, request_id)
);
INSERT INTO jobs_5 SELECT key, name, '', request_id, owner, state, turn, ended, token, lost, worker, lease_end, history,
  checkpoint, checkpoint_iteration, job, furthest, sum FROM jobs;
DELETE FROM sqlite_sequence WHERE name = 'jobs_5';
INSERT INTO sqlite_sequence(name, seq) SELECT 'jobs_5', seq FROM sqlite_sequence WHERE name = 'jobs';
DROP TABLE jobs;
ALTER TABLE jobs_5 RENAME TO jobs;
CREATE INDEX jobs_waiting ON jobs(turn, key) WHERE state = 1;
CREATE INDEX jobs_waiting_of ON jobs(peer) WHERE state = 1;
CREATE INDEX jobs_running ON jobs(key) WHERE worker <> '';
CREATE INDEX jobs_ended ON jobs(ended, key) WHERE ended IS NOT NULL;
CREATE INDEX jobs_of ON jobs(owner, key);
PRAGMA user_version = 5;
)";
// Peers take turns, and each owner has ended jobs of its own. Jobs keep the trace of their call.
constexpr char kToVersion6[] = R"(
DROP INDEX jobs_waiting;
DROP INDEX jobs_waiting_of;
DROP INDEX jobs_ended;
CREATE INDEX jobs_waiting_of ON jobs(peer, turn, key) WHERE state = 1;
CREATE INDEX jobs_ended_of ON jobs(owner, ended, key) WHERE ended IS NOT NULL;
ALTER TABLE jobs ADD COLUMN trace TEXT NOT NULL DEFAULT '';  -- id of the trace of the call that submitted the job
PRAGMA user_version = 6;
)";
constexpr char kToVersion7[] = R"(
ALTER TABLE jobs ADD COLUMN call_due INTEGER;  -- when its webhook is called next, in nanoseconds since 1970; NULL: never
CREATE INDEX jobs_calling ON jobs(call_due) WHERE call_due IS NOT NULL;
PRAGMA user_version = 7;
)";
constexpr char kToVersion8[] = R"(
ALTER TABLE jobs ADD COLUMN needs_device INTEGER NOT NULL DEFAULT 0;  -- read only by shared stores
CREATE INDEX jobs_waiting_anywhere ON jobs(peer, turn, key) WHERE state = 1 AND needs_device = 0;
PRAGMA user_version = 8;
)";
static_assert(v1::JOB_STATE_PENDING == 1);

// The last turn of each peer, which is forgotten with the process.
constexpr char kTurns[] = R"(
PRAGMA temp_store = MEMORY;
CREATE TEMP TABLE IF NOT EXISTS turns(served INTEGER PRIMARY KEY, peer TEXT NOT NULL UNIQUE);
)";

}  // namespace

bool set_up_schema(SqliteDatabase& database) {
  database.run("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA journal_size_limit = 67108864;");
  database.run(kTurns);
  SqliteTransaction transaction(database);
  std::int64_t version = 0;
  if (auto query = database.query("PRAGMA user_version"); query.step()) version = query.number(0);
  if (version > kVersion) return false;
  if (version < 1) database.run(kSchema);
  if (version < 2) database.run(kToVersion2);
  if (version < 3) database.run(kToVersion3);
  if (version < 4) database.run(kToVersion4);
  if (version < 5) database.run(kToVersion5);
  if (version < 6) database.run(kToVersion6);
  if (version < 7) database.run(kToVersion7);
  if (version < 8) database.run(kToVersion8);
  if (version < 4) add_sums(database);
  transaction.commit();
  return true;
}

}  // namespace varimesh::server
