// The steps, and their versions.
#include "server/postgres/schema.h"

#include "server/refusals.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {
namespace {

// Texts that clients choose are bytes, since PostgreSQL's text cannot hold a zero byte. The spec never changes and may
// be large; it has a table of its own, so that it is not written with every change of a job. Room is left in the pages
// of jobs, so that a renewed lease changes no index.
constexpr char kToVersion1[] = R"(
CREATE TABLE jobs(
  key BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,  -- in the order of submission
  name TEXT NOT NULL UNIQUE,
  owner BYTEA NOT NULL,                                 -- of the job; empty: nobody
  request_id BYTEA,                                     -- NULL: none
  peer TEXT NOT NULL,                                   -- whom the limits per peer count; empty: unknown
  state INTEGER NOT NULL,                               -- v1.JobState
  turn BIGINT NOT NULL,                                 -- place in the queue, smallest first, in milliseconds
  ended BIGINT,                                         -- time of the end, in nanoseconds since 1970; NULL: not yet
  token BIGINT NOT NULL,                                -- of the newest claim
  lost INTEGER NOT NULL,                                -- attempts lost with their worker since the last progress
  furthest INTEGER NOT NULL,                            -- last iteration that any attempt has reached
  worker TEXT NOT NULL,                                 -- empty: none
  lease_end BIGINT NOT NULL,                            -- in nanoseconds since 1970, on the database's clock
  history TEXT NOT NULL,                                -- digest; empty: none
  checkpoint TEXT,                                      -- digest; NULL: none
  checkpoint_iteration INTEGER NOT NULL,
  job BYTEA NOT NULL,                                   -- v1.Job without its spec
  UNIQUE(owner, request_id)
) WITH (fillfactor = 70);
CREATE INDEX jobs_waiting ON jobs(turn, key) WHERE state = 1;
CREATE INDEX jobs_waiting_of ON jobs(peer) WHERE state = 1;
CREATE INDEX jobs_running ON jobs(key) WHERE worker <> '';
CREATE INDEX jobs_ended ON jobs(ended, key) WHERE ended IS NOT NULL;
CREATE INDEX jobs_of ON jobs(owner, key);
CREATE TABLE specs(key BIGINT PRIMARY KEY REFERENCES jobs ON DELETE CASCADE, spec BYTEA NOT NULL);  -- v1.JobSpec
CREATE TABLE labels(name BYTEA NOT NULL, value BYTEA NOT NULL, key BIGINT NOT NULL REFERENCES jobs ON DELETE CASCADE,
  PRIMARY KEY(name, value, key));
CREATE INDEX labels_of ON labels(key);
CREATE TABLE events(key BIGINT NOT NULL REFERENCES jobs ON DELETE CASCADE, sequence BIGINT NOT NULL,
  event BYTEA NOT NULL,                                 -- v1.JobEvent
  PRIMARY KEY(key, sequence));
)";
constexpr char kToVersion2[] = R"(
ALTER TABLE jobs ADD COLUMN cancel_unseen BOOLEAN NOT NULL DEFAULT false;  -- CANCELLING, without an event of it yet
)";
constexpr char kToVersion3[] = R"(
CREATE TABLE meshes(one BOOLEAN PRIMARY KEY DEFAULT true CHECK(one), directory TEXT NOT NULL);  -- its name
)";
// Which jobs refer to a digest. The database finds the digests by itself, so that servers of an older version, which do
// not know the table and may still run, cannot leave one out. In a message a digest stands behind its length, 64 or
// '@'. The digest of the mesh is at the beginning of the spec (MeshReference mesh = 1).
constexpr char kToVersion4[] = R"(
CREATE TABLE needs(digest TEXT NOT NULL, key BIGINT NOT NULL REFERENCES jobs ON DELETE CASCADE,
  is_mesh BOOLEAN NOT NULL,                             -- the mesh of the spec, which stays as long as the job
  PRIMARY KEY(digest, key, is_mesh));
CREATE INDEX needs_of ON needs(key) WHERE NOT is_mesh;
CREATE FUNCTION digests_in(bytes BYTEA) RETURNS SETOF TEXT LANGUAGE sql IMMUTABLE AS
  $$ SELECT DISTINCT found[1] FROM regexp_matches(encode(bytes, 'escape'), '@([0-9a-f]{64})', 'g') AS found $$;
CREATE FUNCTION mesh_in(spec BYTEA) RETURNS TEXT LANGUAGE sql IMMUTABLE AS
  $$ SELECT substring(encode(substring(spec FOR 100), 'escape') FROM '@([0-9a-f]{64})') $$;
CREATE FUNCTION note_mesh() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
  INSERT INTO needs SELECT mesh_in(NEW.spec), NEW.key, true WHERE mesh_in(NEW.spec) IS NOT NULL
    ON CONFLICT DO NOTHING;
  RETURN NULL; END $$;
CREATE FUNCTION note_needs() RETURNS trigger LANGUAGE plpgsql AS $$ DECLARE wanted TEXT[]; BEGIN
  wanted := ARRAY(SELECT digests_in(NEW.job)) || NEW.history || NEW.checkpoint;
  DELETE FROM needs WHERE key = NEW.key AND NOT is_mesh AND digest <> ALL(array_remove(wanted, NULL));
  INSERT INTO needs SELECT DISTINCT one, NEW.key, false FROM unnest(wanted) AS one WHERE one <> ''
    ON CONFLICT DO NOTHING;
  RETURN NULL; END $$;
CREATE TRIGGER note_mesh AFTER INSERT OR UPDATE ON specs FOR EACH ROW EXECUTE FUNCTION note_mesh();
CREATE TRIGGER note_needs AFTER UPDATE ON jobs FOR EACH ROW
  WHEN (NEW.checkpoint IS DISTINCT FROM OLD.checkpoint OR NEW.ended IS DISTINCT FROM OLD.ended)
  EXECUTE FUNCTION note_needs();
INSERT INTO needs SELECT mesh_in(spec), key, true FROM specs WHERE mesh_in(spec) IS NOT NULL;
INSERT INTO needs SELECT DISTINCT one, key, false FROM jobs,
  unnest(ARRAY(SELECT digests_in(job)) || history || checkpoint) AS one WHERE one <> '';
)";
// Peers take turns, and each owner has ended jobs of its own. Jobs keep the trace of their call. The turns are written
// with every claim and may be lost with the database's process, so they are not in its log.
constexpr char kToVersion5[] = R"(
ALTER TABLE jobs ADD COLUMN trace TEXT NOT NULL DEFAULT '';  -- of the call that submitted the job
CREATE UNLOGGED TABLE turns(peer TEXT PRIMARY KEY, served BIGINT NOT NULL) WITH (fillfactor = 50);  -- the last turn
CREATE SEQUENCE turn_numbers;
DROP INDEX jobs_waiting, jobs_waiting_of, jobs_running, jobs_ended;
CREATE INDEX jobs_waiting ON jobs(key) WHERE state = 1;
CREATE INDEX jobs_waiting_of ON jobs(peer, turn, key) WHERE state = 1;
CREATE INDEX jobs_running ON jobs(peer) WHERE worker <> '';
CREATE INDEX jobs_ended_of ON jobs(owner, ended, key) WHERE ended IS NOT NULL;
)";
// A spec also names the CAD model on which nodes slide, behind its options and labels. Every digest in a spec counts,
// also one that stands in a text: that keeps a mesh for longer, and loses none.
constexpr char kToVersion6[] = R"(
CREATE OR REPLACE FUNCTION note_mesh() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
  INSERT INTO needs SELECT digests_in(NEW.spec), NEW.key, true ON CONFLICT DO NOTHING;
  RETURN NULL; END $$;
INSERT INTO needs SELECT digests_in(spec), key, true FROM specs ON CONFLICT DO NOTHING;
DROP FUNCTION mesh_in;
)";
constexpr char kToVersion7[] = R"(
ALTER TABLE jobs ADD COLUMN call_due BIGINT;  -- when its webhook is called next, in nanoseconds since 1970; NULL: never
CREATE INDEX jobs_calling ON jobs(call_due) WHERE call_due IS NOT NULL;
)";
// Jobs that need a device go to servers that lend one, and these tell so in a table. Servers of an older version, which
// may still run, submit jobs that any server takes, and take every job.
constexpr char kToVersion8[] = R"(
ALTER TABLE jobs ADD COLUMN needs_device INTEGER NOT NULL DEFAULT 0;  -- 1: needs one; 2: and was told that none is there
CREATE INDEX jobs_waiting_anywhere ON jobs(peer, turn, key) WHERE state = 1 AND needs_device = 0;
CREATE INDEX jobs_waiting_for_device ON jobs(key) WHERE state = 1 AND needs_device = 1;
CREATE TABLE lent_devices(
  worker TEXT PRIMARY KEY,
  lease_end BIGINT NOT NULL,                            -- until when this counts, in nanoseconds since 1970
  names TEXT NOT NULL,                                  -- of the cards, with ", " between them
  devices INTEGER NOT NULL, busy INTEGER NOT NULL, jobs INTEGER NOT NULL
);
)";
static_assert(v1::JOB_STATE_PENDING == 1);

/// Step i leads from version i to version i + 1. A step that was released is never changed.
constexpr const char* kSteps[] = {kToVersion1, kToVersion2, kToVersion3, kToVersion4,
                                  kToVersion5, kToVersion6, kToVersion7, kToVersion8};

constexpr char kVersions[] =
    "CREATE TABLE IF NOT EXISTS varimesh_schema(version INTEGER PRIMARY KEY, made TIMESTAMPTZ NOT NULL DEFAULT now())";

}  // namespace

const int kPostgresVersion = static_cast<int>(std::size(kSteps));

int postgres_version(PostgresConnection& connection) {
  const PostgresRows table = connection.run("SELECT to_regclass('varimesh_schema') IS NOT NULL");
  if (table.view(0, 0) != "t") return 0;
  return static_cast<int>(connection.run("SELECT coalesce(max(version), 0) FROM varimesh_schema").number(0, 0));
}

Answer<int> migrate_postgres(PostgresConnection& connection) {
  PostgresTransaction transaction(connection);
  // Released with the transaction. The number is only ours: it is "varimesh" in bytes.
  connection.run(
      "SET LOCAL statement_timeout = 0; SET LOCAL lock_timeout = 0; SELECT "
      "pg_advisory_xact_lock(x'766172696d657368'::bigint)");
  connection.run(kVersions);
  const int before = postgres_version(connection);
  if (before > kPostgresVersion) return postgres_too_new(before);
  for (int version = before; version < kPostgresVersion; ++version) {
    connection.run(kSteps[version]);
    connection.run("INSERT INTO varimesh_schema(version) VALUES(" + std::to_string(version + 1) + ")");
  }
  transaction.commit();
  return before;
}

Refusal postgres_too_new(int version) {
  return internal_failure("The database was made by a newer varimeshd (its tables have version " +
                          std::to_string(version) + ", this program knows " + std::to_string(kPostgresVersion) +
                          "); run that version, or choose another database.");
}

}  // namespace varimesh::server
