// The calls of PostgresJobStore that workers make: claims and leases.
#include <type_traits>
#include <vector>

#include "server/postgres/postgres_job_store.h"
#include "server/postgres/rows.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using postgres::Lock;

std::int64_t nanoseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

/// Returns the peers that have waiting jobs, and of which fewer than `most` run (0: any number), in the order in which
/// they are served (turns.h). The database finds each of them in an index, however many jobs it has.
std::vector<std::string> peers_in_turn(PostgresConnection& connection, int most) {
  const PostgresRows rows = connection.query(
      "WITH RECURSIVE waiting(peer) AS ((SELECT peer FROM jobs WHERE state = 1 ORDER BY peer LIMIT 1) UNION ALL "
      "SELECT (SELECT peer FROM jobs WHERE state = 1 AND peer > waiting.peer ORDER BY peer LIMIT 1) FROM waiting "
      "WHERE waiting.peer IS NOT NULL), "
      "running AS (SELECT peer, count(*) AS jobs FROM jobs WHERE worker <> '' GROUP BY peer) "
      "SELECT peer FROM waiting LEFT JOIN running USING(peer) LEFT JOIN turns USING(peer) WHERE peer IS NOT NULL "
      "AND (peer = '' OR $1::bigint = 0 OR coalesce(jobs, 0) < $1::bigint) "
      "ORDER BY coalesce(jobs, 0), coalesce(served, 0), peer",
      PostgresValues().add(most));
  std::vector<std::string> peers;
  for (int i = 0; i < rows.count(); ++i) peers.push_back(rows.text(i, 0));
  return peers;
}

/// Notes that it was the peer's turn. Waits for no other worker: one that notes a turn of the same peer at this moment
/// does it for both.
void take_turn(PostgresConnection& connection, const std::string& peer) {
  connection.query(
      "WITH mine AS (SELECT peer FROM turns WHERE peer = $1 FOR UPDATE SKIP LOCKED), "
      "noted AS (UPDATE turns SET served = nextval('turn_numbers') FROM mine WHERE turns.peer = mine.peer) "
      "INSERT INTO turns SELECT $1, nextval('turn_numbers') WHERE NOT EXISTS(SELECT 1 FROM turns WHERE peer = $1) "
      "ON CONFLICT DO NOTHING",
      PostgresValues().add(peer));
}

}  // namespace

template <class Result>
Answer<Result> PostgresJobStore::write(const Claim& claim,
                                       const std::function<Result(const JobTransitions&, JobRecord&)>& work,
                                       PostgresTransactions::Outcome outcome) {
  return database_.write<Result>(
      [&](PostgresWork& transaction) -> Answer<Result> {
        auto row = postgres::load(transaction.connection, claim.name, Lock::Row);
        if (!row) return tl::unexpected(row.error());
        if (const auto checked = transaction.transitions.check(row->record, claim); !checked)
          return tl::unexpected(checked.error());
        Result result = work(transaction.transitions, row->record);
        postgres::save(transaction.connection, *row);
        if constexpr (std::is_same_v<Result, Changed>) postgres::save_events(transaction, row->key, result);
        return result;
      },
      outcome);
}

Answer<std::optional<Claimed>> PostgresJobStore::claim(const std::string& worker) {
  using Result = std::optional<Claimed>;
  const int most = database_.settings().max_running_of_peer;
  // The queue is usually empty, and then no transaction is needed.
  const auto seen =
      database_.read<std::vector<std::string>>([&](PostgresConnection& connection) -> Answer<std::vector<std::string>> {
        return peers_in_turn(connection, most);
      });
  if (!seen) return tl::unexpected(seen.error());
  if (seen->empty()) return Result();
  return database_.write<Result>([&](PostgresWork& transaction) -> Answer<Result> {
    PostgresConnection& connection = transaction.connection;
    // Two workers that count at the same time would both take the last place of a peer.
    if (most > 0) connection.query("SELECT pg_advisory_xact_lock(hashtext('varimesh claim'))");
    for (const std::string& peer : most > 0 ? peers_in_turn(connection, most) : *seen) {
      const PostgresRows rows = connection.query(
          postgres::select_rows(
              "WHERE state = 1 AND peer = $1 ORDER BY turn, jobs.key LIMIT 1 FOR UPDATE OF jobs SKIP LOCKED"),
          PostgresValues().add(peer));
      if (rows.count() == 0) continue;  // other workers have just claimed the last ones
      auto row = postgres::read_row(rows, 0);
      if (!row) {
        postgres::set_aside(connection, rows.number(0, 0));
        return Result();  // the next call finds the next job
      }
      Changed changed = transaction.transitions.claim(row->record, worker);
      postgres::save(connection, *row);
      postgres::save_events(transaction, row->key, changed);
      take_turn(connection, peer);
      return Claimed{claim_of(row->record), std::move(changed.events)};
    }
    return Result();
  });
}

Answer<bool> PostgresJobStore::renew_lease(const Claim& claim) {
  return write<bool>(claim, [](const JobTransitions& transitions, JobRecord& record) {
    transitions.renew(record);
    return record.job.state() == v1::JOB_STATE_CANCELLING;
  });
}

Answer<void> PostgresJobStore::note_progress(const Claim& claim, const v1::Iteration& iteration,
                                             std::int64_t last_sequence) {
  if (database_.is_away()) return store_unavailable();  // the run does not wait for it; other calls try again
  return write<bool>(
             claim,
             [&](const JobTransitions& transitions, JobRecord& record) {
               transitions.note_progress(record, iteration, last_sequence);
               return true;
             },
             PostgresTransactions::Outcome::CanBeSkipped)
      .map([](bool) {});
}

Answer<Changed> PostgresJobStore::note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) {
  return write<Changed>(claim, [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.note_checkpoint(record, checkpoint);
  });
}

Answer<Changed> PostgresJobStore::finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) {
  return write<Changed>(claim, [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.finish(record, ending, last_sequence);
  });
}

Answer<Changed> PostgresJobStore::see_cancel(const Claim& claim, std::int64_t last_sequence) {
  return write<Changed>(claim, [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.see_cancel(record, last_sequence);
  });
}

Answer<std::vector<Changed>> PostgresJobStore::take_back(const std::string& worker,
                                                         const std::set<std::string>& running) {
  using Result = std::vector<Changed>;
  return database_.write<Result>([&](PostgresWork& transaction) -> Answer<Result> {
    PostgresConnection& connection = transaction.connection;
    const TimePoint now = transaction.transitions.settings().clock();
    // While the database was away nobody could renew a lease, so none counts as expired until one lease time after its
    // start. This does not apply to a clock of a test.
    const std::int64_t started =
        database_.settings().clock
            ? 0
            : connection.query("SELECT (extract(epoch FROM pg_postmaster_start_time()) * 1000000)::bigint * 1000")
                  .number(0, 0);
    const bool may_expire = nanoseconds(now) - started > nanoseconds(TimePoint(database_.settings().lease));
    const PostgresRows rows = connection.query(
        postgres::select_rows("WHERE worker <> '' AND (worker = $1 OR lease_end <= $2) FOR UPDATE OF jobs SKIP LOCKED"),
        PostgresValues().add(worker).add(may_expire ? nanoseconds(now) : std::int64_t{0}));
    Result all;
    for (int i = 0; i < rows.count(); ++i) {
      auto row = postgres::read_row(rows, i);
      if (!row) {
        postgres::set_aside(connection, rows.number(i, 0));
        continue;
      }
      if (!transaction.transitions.is_lost(row->record, worker, running)) continue;
      all.push_back(transaction.transitions.take_back(row->record));
      postgres::save(connection, *row);
      postgres::save_events(transaction, row->key, all.back());
    }
    return all;
  });
}

}  // namespace varimesh::server
