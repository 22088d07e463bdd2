// The calls that change jobs. The rules are in job_record.cpp, and the rows in job_rows.cpp.
#include "server/jobs/job_store.h"

#include <limits>
#include <type_traits>

#include "server/jobs/job_rows.h"
#include "server/jobs/timestamps.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using Outcome = JobDatabase::Outcome;

/// How many jobs may be missing from a count of waiting jobs that is not repeated for some seconds.
constexpr std::int64_t kCountMargin = 1000;
constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();

/// Returns the answer of `work`, or why the database cannot be used. If either is a failure, nothing is written.
template <class Work>
std::invoke_result_t<Work, JobWork&> write(JobDatabase& database, const Work& work,
                                           Outcome outcome = Outcome::MustBeKnown) {
  std::invoke_result_t<Work, JobWork&> result;
  const auto run = [&](JobWork& transaction) {
    result = work(transaction);
    return result.has_value();
  };
  if (const auto failed = database.write(run, outcome)) return tl::unexpected(*failed);
  return result;
}

/// Repeats a change that ends or deletes a job, and so frees room, as long as the disk is full and room is kept for it.
Answer<Changed> with_kept_room(JobDatabase& database, const std::function<Answer<Changed>()>& change) {
  Answer<Changed> changed = change();
  while (!changed && changed.error().reason == "STORE_FULL" && database.spend_room()) changed = change();
  return changed;
}

/// Changes the job of a claim if the claim is still valid. Returns what `work` returns.
template <class Work>
auto change(JobDatabase& database, const Claim& claim, const Work& work, Outcome outcome = Outcome::MustBeKnown) {
  using Result = std::invoke_result_t<Work, const JobTransitions&, JobRecord&>;
  return write(
      database,
      [&](JobWork& transaction) -> Answer<Result> {
        auto row = load_job(transaction.sql, claim.name, true);
        if (!row) return tl::unexpected(row.error());
        const auto checked = transaction.transitions.check(row->record, claim);
        if (!checked) return tl::unexpected(checked.error());
        Result result = work(transaction.transitions, row->record);
        if constexpr (std::is_same_v<Result, Changed>)
          save_job(transaction, *row, result);
        else
          save_job(transaction, *row);
        return result;
      },
      outcome);
}

/// Returns the condition of the jobs that can be claimed. An index has them in the order of their peers and turns.
std::string is_waiting(const ClaimFilter& filter) {
  return filter.needs_no_device ? "state = 1 AND needs_device = 0" : "state = 1";
}

/// Returns the peers that have jobs that are `waiting`, and of which fewer than `most` run (0: any number), in the
/// order in which they are served. The database finds each of them in an index, however many jobs it has.
std::vector<std::string> peers_in_turn(Sql& sql, const std::string& waiting, int most) {
  std::vector<std::string> peers;
  sql.ask("WITH RECURSIVE waiting(peer) AS (SELECT (SELECT peer FROM jobs WHERE " + waiting +
              " ORDER BY peer LIMIT 1) UNION ALL SELECT (SELECT peer FROM jobs WHERE " + waiting +
              " AND peer > waiting.peer ORDER BY peer LIMIT 1) FROM waiting WHERE waiting.peer IS NOT NULL), "
              "running AS (SELECT peer, count(*) AS number FROM jobs WHERE worker <> '' GROUP BY peer) "
              "SELECT waiting.peer FROM waiting LEFT JOIN running ON running.peer = waiting.peer "
              "LEFT JOIN turns ON turns.peer = waiting.peer WHERE waiting.peer IS NOT NULL "
              "AND (waiting.peer = '' OR $1 = 0 OR coalesce(number, 0) < $1) "
              "ORDER BY coalesce(number, 0), coalesce(served, 0), waiting.peer",
          SqlValues().add(most), [&](const SqlRow& row) { peers.push_back(row.text(0)); });
  return peers;
}

/// Returns the job that has this request id; nothing if there is none. ALREADY_EXISTS if it has another spec.
Answer<std::optional<v1::Job>> find_request(Sql& sql, const Submission& submission) {
  using Result = std::optional<v1::Job>;
  Answer<Result> found = Result();
  if (submission.request_id.empty()) return found;
  sql.ask(select_jobs(sql, "WHERE owner = $1 AND request_id = $2"),
          SqlValues().add(submission.owner).add(submission.request_id), [&](const SqlRow& from) {
            found = read_job(sql, from).map([](const JobRow& row) { return Result(row.record.job); });
          });
  if (!found || !*found) return found;
  if (const auto same = check_same(**found, submission); !same) return tl::unexpected(same.error());
  return found;
}

}  // namespace

JobStore::JobStore(std::unique_ptr<JobDatabase> database, const JobStoreSettings& settings)
    : database_(std::move(database)), settings_(settings) {}

JobStore::~JobStore() = default;

bool JobStore::durable() const { return database_->durable(); }
bool JobStore::shared() const { return database_->shared(); }
void JobStore::stop_waiting() { database_->stop_waiting(); }
void JobStore::listen(std::function<void(const News&)> listener) { database_->listen(std::move(listener)); }

// ===== calls of clients =====

bool JobStore::has_ample_room(int max_pending) {
  std::lock_guard lock(waiting_mutex_);
  // A count of a hundred thousand takes as long as several submissions, so far from the limit it serves for longer.
  const bool is_far = waiting_ < max_pending / 2;
  return counted_ && std::chrono::steady_clock::now() - *counted_ < std::chrono::seconds(is_far ? 10 : 1) &&
         waiting_ + kCountMargin < max_pending;
}

Answer<void> JobStore::check_room(Sql& sql, const Submission& submission) {
  const auto count_of_peer = [&] {
    return sql.number("SELECT count(*) FROM jobs WHERE state = 1 AND peer = $1", SqlValues().add(submission.peer));
  };
  // With many waiting jobs the count takes milliseconds.
  if (!has_ample_room(submission.max_pending)) {
    const std::int64_t waiting = sql.number(kCountWaiting);
    if (waiting >= submission.max_pending && is_full(waiting, count_of_peer(), submission.max_pending))
      return queue_full(static_cast<int>(waiting));
    std::lock_guard lock(waiting_mutex_);
    waiting_ = waiting;
    counted_ = std::chrono::steady_clock::now();
  }
  if (submission.max_pending_of_peer == 0) return {};
  const std::int64_t of_peer = count_of_peer();
  if (of_peer < submission.max_pending_of_peer) return {};
  return too_many_waiting(submission.peer, static_cast<int>(of_peer));
}

Answer<Changed> JobStore::submit(const Submission& submission) {
  return write(
      *database_,
      [&](JobWork& work) -> Answer<Changed> {
        auto there = find_request(work.sql, submission);
        if (!there) return tl::unexpected(there.error());
        if (*there) return Changed{**there, {}, {}};
        if (const auto room = check_room(work.sql, submission); !room) return tl::unexpected(room.error());
        JobRow row;
        Changed changed = work.transitions.create(row.record, submission);
        if (!insert_job(work, submission, row, changed)) {
          there = find_request(work.sql, submission);
          if (!there) return tl::unexpected(there.error());
          if (*there) return Changed{**there, {}, {}};
          return store_unavailable();  // that job was deleted at this moment
        }
        std::lock_guard lock(waiting_mutex_);
        ++waiting_;
        return changed;
      },
      Outcome::CanBeAskedAgain);
}

Answer<Changed> JobStore::request_cancel(const std::string& name, std::int64_t last_sequence) {
  const auto cancel = [&](JobWork& work) -> Answer<Changed> {
    auto row = load_job(work.sql, name, true);
    if (!row) return tl::unexpected(row.error());
    Changed changed = work.transitions.cancel(row->record, last_sequence);
    if (!changed.events.empty()) save_job(work, *row, changed);
    return changed;
  };
  return with_kept_room(*database_, [&] { return write(*database_, cancel, Outcome::CanBeAskedAgain); });
}

Answer<Changed> JobStore::ask_to_cancel(const std::string& name) {
  if (!shared()) return request_cancel(name, 0);
  return write(
      *database_,
      [&](JobWork& work) -> Answer<Changed> {
        auto row = load_job(work.sql, name, true);
        if (!row) return tl::unexpected(row.error());
        const v1::JobState before = row->record.job.state();
        Changed changed = work.transitions.ask_to_cancel(row->record);
        if (changed.job.state() == before) return changed;
        save_job(work, *row, changed);
        if (row->record.cancel_unseen) work.news.push_back({News::Kind::Cancel, name});
        return changed;
      },
      Outcome::CanBeAskedAgain);
}

Answer<Changed> JobStore::remove(const std::string& name) {
  const auto remove = [&](JobWork& work) -> Answer<Changed> {
    const auto row = load_job(work.sql, name, true);
    Changed changed;
    changed.job.set_name(name);
    if (!row && row.error().code != Failure::Code::DataLoss) return tl::unexpected(row.error());
    if (row && !has_ended(row->record.job.state())) return job_not_ended(name);
    if (row) changed = {row->record.job, {}, digests_of(row->record)};
    delete_job(work.sql, work.sql.number("SELECT key FROM jobs WHERE name = $1", SqlValues().add(name)));
    return changed;
  };
  return with_kept_room(*database_, [&] { return write(*database_, remove, Outcome::CanBeAskedAgain); });
}

// ===== calls of workers =====

Answer<std::optional<Claimed>> JobStore::claim(const std::string& worker, const ClaimFilter& filter) {
  using Result = std::optional<Claimed>;
  const std::string waiting = is_waiting(filter);
  // The queue is usually empty, and then no transaction is needed.
  const auto waits = read_jobs(*database_, [&](Sql& sql) -> Answer<bool> {
    return sql.number("SELECT count(*) FROM (SELECT 1 FROM jobs WHERE " + waiting + " LIMIT 1) AS first") > 0;
  });
  if (!waits) return tl::unexpected(waits.error());
  if (!*waits) return Result();
  return write(*database_, [&](JobWork& work) -> Answer<Result> {
    Sql& sql = work.sql;
    const int most = filter.only_first ? 1 : settings_.max_running_of_peer;
    // Two workers that count at the same time would both take the last place of a peer.
    if (most > 0) sql.ask(sql.dialect().lock_claims);
    for (const std::string& peer : peers_in_turn(sql, waiting, most)) {
      std::int64_t key = 0;
      Answer<JobRow> row;
      sql.ask(select_jobs(sql, "WHERE " + waiting + " AND peer = $1 ORDER BY turn, jobs.key LIMIT 1" +
                                   sql.dialect().lock_or_skip),
              SqlValues().add(peer), [&](const SqlRow& from) {
                key = from.number(0);
                row = read_job(sql, from);
              });
      if (key == 0) continue;  // other workers have just claimed the last ones, or an index is damaged
      if (!row) {
        set_aside(sql, key);
        return Result();  // the next call finds the next job
      }
      Changed changed = work.transitions.claim(row->record, worker);
      save_job(work, *row, changed);
      sql.ask(sql.dialect().take_turn, SqlValues().add(peer));
      return Claimed{claim_of(row->record), std::move(changed.events)};
    }
    return Result();
  });
}

Answer<bool> JobStore::renew_lease(const Claim& claim) {
  return change(*database_, claim, [](const JobTransitions& transitions, JobRecord& record) {
    transitions.renew(record);
    return record.job.state() == v1::JOB_STATE_CANCELLING;
  });
}

Answer<void> JobStore::note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) {
  if (database_->is_away()) return store_unavailable();  // the run does not wait for it; other calls try again
  return change(
             *database_, claim,
             [&](const JobTransitions& transitions, JobRecord& record) {
               transitions.note_progress(record, iteration, last_sequence);
               return true;
             },
             Outcome::CanBeSkipped)
      .map([](bool) {});
}

Answer<Changed> JobStore::note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) {
  return change(*database_, claim, [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.note_checkpoint(record, checkpoint);
  });
}

Answer<Changed> JobStore::finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) {
  const auto finish = [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.finish(record, ending, last_sequence);
  };
  return with_kept_room(*database_, [&] { return change(*database_, claim, finish); });
}

Answer<std::optional<v1::Job>> JobStore::claim_call(std::chrono::milliseconds patience) {
  using Result = std::optional<v1::Job>;
  // Usually no call is due, and then no transaction is needed.
  const auto waits = read_jobs(*database_, [&](Sql& sql) -> Answer<bool> {
    SqlValues values;
    add_time(values);
    return sql.number(std::string("SELECT count(*) FROM (SELECT 1 FROM jobs WHERE call_due <= coalesce($1, ") +
                          sql.dialect().now + ") LIMIT 1) AS first",
                      values) > 0;
  });
  if (!waits) return tl::unexpected(waits.error());
  if (!*waits) return Result();
  return write(*database_, [&](JobWork& work) -> Answer<Result> {
    Sql& sql = work.sql;
    std::int64_t key = 0;
    Answer<JobRow> row;
    sql.ask(select_jobs(sql, std::string("WHERE call_due <= $1 ORDER BY call_due, jobs.key LIMIT 1") +
                                 sql.dialect().lock_or_skip),
            SqlValues().add(nanoseconds(work.transitions.settings().clock())), [&](const SqlRow& from) {
              key = from.number(0);
              row = read_job(sql, from);
            });
    if (key == 0) return Result();
    if (!row) {
      set_aside(sql, key);
      return Result();
    }
    work.transitions.claim_call(row->record, patience);
    save_job(work, *row);
    return Result(std::move(row->record.job));
  });
}

void JobStore::add_time(SqlValues& values) const {
  if (settings_.clock)
    values.add(nanoseconds(settings_.clock()));
  else
    values.add_null();
}

Answer<void> JobStore::note_call(const std::string& name, const CallOutcome& outcome) {
  const auto note = [&](JobWork& work) -> Answer<void> {
    auto row = load_job(work.sql, name, true);
    if (!row) return tl::unexpected(row.error());
    if (work.transitions.note_call(row->record, outcome)) save_job(work, *row);
    return {};
  };
  return write(*database_, note);
}

Answer<Changed> JobStore::see_cancel(const Claim& claim, std::int64_t last_sequence) {
  if (!shared()) return Changed{};
  return change(*database_, claim, [&](const JobTransitions& transitions, JobRecord& record) {
    return transitions.see_cancel(record, last_sequence);
  });
}

Answer<std::vector<Changed>> JobStore::take_back(const std::string& worker, const std::set<std::string>& running) {
  using Result = std::vector<Changed>;
  const auto claimed = read_jobs(*database_, [](Sql& sql) -> Answer<bool> { return sql.number(kCountRunning) > 0; });
  if (!claimed) return tl::unexpected(claimed.error());
  if (!*claimed) return Result();
  return write(*database_, [&](JobWork& work) -> Answer<Result> {
    Sql& sql = work.sql;
    // In a database that nobody else uses all rows are looked at, so that damaged ones are found.
    std::int64_t expired = kLargest;
    if (shared()) {
      const TimePoint now = work.transitions.settings().clock();
      // While the database was away nobody could renew a lease, so none counts as expired until one lease time after
      // its start. This does not apply to a clock of a test.
      const std::int64_t started = settings_.clock ? 0 : sql.number(sql.dialect().started);
      const bool may_expire = nanoseconds(now) - started > nanoseconds(TimePoint(settings_.lease));
      expired = may_expire ? nanoseconds(now) : 0;
    }
    std::vector<JobRow> rows;
    std::vector<std::int64_t> damaged;
    sql.ask(select_jobs(sql, std::string("WHERE worker <> '' AND (worker = $1 OR lease_end <= $2)") +
                                 sql.dialect().lock_or_skip),
            SqlValues().add(worker).add(expired), [&](const SqlRow& from) {
              if (auto row = read_job(sql, from))
                rows.push_back(std::move(*row));
              else
                damaged.push_back(from.number(0));
            });
    for (const std::int64_t key : damaged) set_aside(sql, key);
    Result all;
    for (JobRow& row : rows) {
      if (!work.transitions.is_lost(row.record, worker, running)) continue;
      all.push_back(work.transitions.take_back(row.record));
      save_job(work, row, all.back());
    }
    return all;
  });
}

}  // namespace varimesh::server
