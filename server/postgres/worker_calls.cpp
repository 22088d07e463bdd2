// The calls of PostgresJobStore that workers make: claims and leases.
#include <type_traits>

#include "server/postgres/postgres_job_store.h"
#include "server/postgres/rows.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using postgres::Lock;

std::int64_t nanoseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
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
        if constexpr (std::is_same_v<Result, Changed>) postgres::save_events(transaction.connection, row->key, result);
        return result;
      },
      outcome);
}

Answer<std::optional<Claimed>> PostgresJobStore::claim(const std::string& worker) {
  using Result = std::optional<Claimed>;
  // The queue is usually empty, and then no transaction is needed.
  const auto any = database_.read<bool>([](PostgresConnection& connection) -> Answer<bool> {
    return connection.query("SELECT 1 FROM jobs WHERE state = 1 LIMIT 1").count() > 0;
  });
  if (!any) return tl::unexpected(any.error());
  if (!*any) return Result();
  return database_.write<Result>([&](PostgresWork& transaction) -> Answer<Result> {
    PostgresConnection& connection = transaction.connection;
    const int most = database_.settings().max_running_of_peer;
    // Two workers that count at the same time would both take the last place of a peer.
    if (most > 0) connection.query("SELECT pg_advisory_xact_lock(hashtext('varimesh claim'))");
    const PostgresRows rows =
        most > 0
            ? connection.query(
                  postgres::select_rows(
                      "WHERE state = 1 AND peer NOT IN (SELECT peer FROM jobs WHERE worker <> '' AND peer <> '' "
                      "GROUP BY peer HAVING count(*) >= $1) ORDER BY turn, jobs.key LIMIT 1 FOR UPDATE OF jobs SKIP "
                      "LOCKED"),
                  PostgresValues().add(most))
            : connection.query(postgres::select_rows(
                  "WHERE state = 1 ORDER BY turn, jobs.key LIMIT 1 FOR UPDATE OF jobs SKIP LOCKED"));
    if (rows.count() == 0) return Result();
    auto row = postgres::read_row(rows, 0);
    if (!row) {
      postgres::set_aside(connection, rows.number(0, 0));
      return Result();  // the next call finds the next job
    }
    Changed changed = transaction.transitions.claim(row->record, worker);
    postgres::save(connection, *row);
    postgres::save_events(connection, row->key, changed);
    return Claimed{claim_of(row->record), std::move(changed.events)};
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
      postgres::save_events(connection, row->key, all.back());
    }
    return all;
  });
}

}  // namespace varimesh::server
