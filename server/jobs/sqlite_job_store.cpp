// The calls of the store. The rules are in job_record.cpp, and the rows in sqlite_rows.cpp.
#include "server/jobs/sqlite_job_store.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "server/jobs/sqlite_rows.h"
#include "server/jobs/sqlite_schema.h"
#include "server/jobs/timestamps.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

Refusal refusal_of(const SqliteError& error) {
  if (error.disk_full()) return store_full("The server's disk has no room for the job");
  return internal_failure(std::string("The job store failed (") + error.what() + ").");
}

}  // namespace

// ===== opening =====

SqliteJobStore::SqliteJobStore(const std::string& path, const JobStoreSettings& settings)
    : transitions_(settings), writer_(path), reader_(path) {}

Answer<std::unique_ptr<SqliteJobStore>> SqliteJobStore::open(const std::string& path,
                                                             const JobStoreSettings& settings) {
  try {
    std::unique_ptr<SqliteJobStore> store(new SqliteJobStore(path, settings));
    if (!set_up_schema(store->writer_))
      return internal_failure(
          path + " was written by a newer version of varimeshd; run that version, or choose another directory.");
    store->reader_.run("PRAGMA query_only = 1");
    return store;
  } catch (const SqliteError& error) {
    return internal_failure(std::string("The job store cannot be opened (") + error.what() +
                            "); choose another directory.");
  }
}

// ===== transactions =====

void SqliteJobStore::write(Write& change) {
  std::unique_lock lock(queue_mutex_);
  queue_.push_back(&change);
  written_.wait(lock, [&] { return change.done || !writing_; });
  if (change.done) return;
  writing_ = true;
  std::vector<Write*> changes;
  changes.swap(queue_);
  lock.unlock();
  write_all(changes);
  lock.lock();
  for (Write* each : changes) each->done = true;
  writing_ = false;
  written_.notify_all();
}

void SqliteJobStore::write_all(const std::vector<Write*>& changes) {
  const auto fail_all = [&](const SqliteError& error) {
    for (Write* change : changes) change->failed = refusal_of(error).value();
  };
  try {
    SqliteTransaction transaction(writer_);
    for (Write* change : changes) {
      writer_.run("SAVEPOINT change");
      if (!change->work(writer_)) writer_.run("ROLLBACK TO change");
      writer_.run("RELEASE change");
    }
    transaction.commit();
  } catch (const SqliteError& error) {
    fail_all(error);
  }
}

template <class Result>
Answer<Result> SqliteJobStore::write(const std::function<Answer<Result>(SqliteDatabase&)>& work) {
  Answer<Result> result;
  Write change;
  change.work = [&](SqliteDatabase& database) {
    result = work(database);
    return result.has_value();
  };
  write(change);
  if (change.failed) return tl::unexpected(*change.failed);
  return result;
}

template <class Result>
Answer<Result> SqliteJobStore::read(const std::function<Answer<Result>(SqliteDatabase&)>& work) {
  std::lock_guard lock(reader_mutex_);
  try {
    return work(reader_);
  } catch (const SqliteError& error) {
    return refusal_of(error);
  }
}

template <class Result>
Answer<Result> SqliteJobStore::write(const Claim& claim, const std::function<Result(JobRecord&)>& work) {
  return write<Result>([&](SqliteDatabase& database) -> Answer<Result> {
    auto row = load_job(database, claim.name);
    if (!row) return tl::unexpected(row.error());
    if (const auto checked = transitions_.check(row->record, claim); !checked) return tl::unexpected(checked.error());
    Result result = work(row->record);
    save_job(database, *row);
    if constexpr (std::is_same_v<Result, Changed>) save_events(database, row->key, result);
    return result;
  });
}

// ===== calls of clients =====

Answer<Changed> SqliteJobStore::submit(const Submission& submission) {
  return write<Changed>([&](SqliteDatabase& database) -> Answer<Changed> {
    if (!submission.request_id.empty()) {
      auto query = database.query(select_job_rows("WHERE owner = ? AND request_id = ?"));
      if (query.bind(submission.owner).bind(submission.request_id).step()) {
        const auto row = read_job_row(query);
        if (!row) return tl::unexpected(row.error());
        if (const auto same = check_same(row->record.job, submission); !same) return tl::unexpected(same.error());
        return Changed{row->record.job, {}, {}};
      }
    }
    auto pending = database.query("SELECT COUNT(*) FROM jobs WHERE state = 1");
    pending.step();
    auto of_peer = database.query("SELECT COUNT(*) FROM jobs WHERE state = 1 AND peer = ?");
    of_peer.bind(submission.peer).step();
    if (is_full(pending.number(0), of_peer.number(0), submission.max_pending))
      return queue_full(static_cast<int>(pending.number(0)));
    if (submission.max_pending_of_peer > 0 && of_peer.number(0) >= submission.max_pending_of_peer)
      return too_many_waiting(submission.peer, static_cast<int>(of_peer.number(0)));

    JobRow row;
    Changed changed = transitions_.create(row.record, submission);
    insert_job(database, submission, row);
    save_job(database, row);
    save_events(database, row.key, changed);
    return changed;
  });
}

Answer<v1::Job> SqliteJobStore::get(const std::string& name) {
  return read<v1::Job>([&](SqliteDatabase& database) {
    return load_job(database, name).map([](JobRow&& row) { return std::move(row.record.job); });
  });
}

Answer<JobPage> SqliteJobStore::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  const auto below = parse_page_token(page_token);
  if (!below) return tl::unexpected(below.error());
  std::string statement = select_job_rows("WHERE jobs.key < ?");
  std::string separator = " AND state IN (";
  for (const v1::JobState state : filter.states) {
    statement += separator + std::to_string(static_cast<int>(state));
    separator = ", ";
  }
  if (!filter.states.empty()) statement += ")";
  if (filter.owner) statement += " AND owner = ?";
  for (std::size_t i = 0; i < filter.labels.size(); ++i)
    statement += " AND EXISTS(SELECT 1 FROM labels WHERE labels.key = jobs.key AND labels.name = ? AND value = ?)";
  statement += " ORDER BY jobs.key DESC LIMIT ?";

  return read<JobPage>([&](SqliteDatabase& database) -> Answer<JobPage> {
    auto query = database.query_once(statement);
    query.bind(*below > 0 ? *below : std::numeric_limits<std::int64_t>::max());
    if (filter.owner) query.bind(*filter.owner);
    for (const auto& [name, value] : filter.labels) query.bind(name).bind(value);
    query.bind(page_size + 1);
    JobPage page;
    int count = 0;
    std::size_t bytes = 0;
    for (std::int64_t last = 0; query.step();) {
      bytes += query.view(8).size() + query.view(9).size();  // the job and its spec
      if (count == page_size || (bytes > filter.most_bytes && count > 0)) {
        page.next_page_token = std::to_string(last);
        break;
      }
      ++count;
      last = query.number(0);
      if (auto row = read_job_row(query)) page.jobs.push_back(std::move(row->record.job));  // no damaged ones
    }
    return page;
  });
}

Answer<JobCounts> SqliteJobStore::counts() {
  return read<JobCounts>([](SqliteDatabase& database) -> Answer<JobCounts> {
    auto query = database.query(
        "SELECT (SELECT COUNT(*) FROM jobs WHERE state = 1), (SELECT COUNT(*) FROM jobs WHERE worker <> '')");
    query.step();
    return JobCounts{static_cast<int>(query.number(0)), static_cast<int>(query.number(1))};
  });
}

Answer<std::optional<TimePoint>> SqliteJobStore::oldest_pending() {
  return read<std::optional<TimePoint>>([](SqliteDatabase& database) -> Answer<std::optional<TimePoint>> {
    auto query = database.query(select_job_rows(
        "WHERE state = 1 AND jobs.key = (SELECT MIN(key) FROM jobs INDEXED BY jobs_waiting_of WHERE state = 1)"));
    if (!query.step()) return std::nullopt;
    return read_job_row(query).map(
        [](const JobRow& row) { return std::optional(time_point(row.record.job.create_time())); });
  });
}

Answer<std::vector<v1::JobEvent>> SqliteJobStore::events(const std::string& name) {
  return read<std::vector<v1::JobEvent>>([&](SqliteDatabase& database) -> Answer<std::vector<v1::JobEvent>> {
    const auto row = load_job(database, name);
    if (!row) return tl::unexpected(row.error());
    return load_events(database, *row);
  });
}

Answer<Changed> SqliteJobStore::request_cancel(const std::string& name, std::int64_t last_sequence) {
  return write<Changed>([&](SqliteDatabase& database) -> Answer<Changed> {
    auto row = load_job(database, name);
    if (!row) return tl::unexpected(row.error());
    Changed changed = transitions_.cancel(row->record, last_sequence);
    if (changed.events.empty()) return changed;
    save_job(database, *row);
    save_events(database, row->key, changed);
    return changed;
  });
}

Answer<std::string> SqliteJobStore::history_digest(const std::string& name) {
  return read<std::string>([&](SqliteDatabase& database) {
    return load_job(database, name).map([](const JobRow& row) { return row.record.history_digest; });
  });
}

Answer<Changed> SqliteJobStore::remove(const std::string& name) {
  return write<Changed>([&](SqliteDatabase& database) -> Answer<Changed> {
    auto row = load_job(database, name);
    if (!row && row.error().code == Failure::Code::DataLoss) {
      auto damaged = database.query("SELECT key FROM jobs WHERE name = ?");
      if (damaged.bind(name).step()) delete_job(database, damaged.number(0));
      Changed changed;  // what the job refers to is not known
      changed.job.set_name(name);
      return changed;
    }
    if (!row) return tl::unexpected(row.error());
    if (!has_ended(row->record.job.state())) return job_not_ended(name);
    delete_job(database, row->key);
    return Changed{row->record.job, {}, digests_of(row->record)};
  });
}

Answer<std::vector<std::string>> SqliteJobStore::ended_beyond(std::size_t keep, TimePoint before) {
  return read<std::vector<std::string>>([&](SqliteDatabase& database) -> Answer<std::vector<std::string>> {
    std::vector<std::string> names;
    for (const std::string& owner : values_of(database, "owner", "ended IS NOT NULL")) {
      auto query = database.query(
          "SELECT name FROM jobs WHERE owner = ?1 AND ended IS NOT NULL AND ended < ?2 AND (ended, key) <= "
          "(SELECT ended, key FROM jobs WHERE owner = ?1 AND ended IS NOT NULL ORDER BY ended DESC, key DESC "
          "LIMIT 1 OFFSET ?3) ORDER BY ended DESC, key DESC");
      query.bind(owner).bind(std::chrono::duration_cast<std::chrono::nanoseconds>(before.time_since_epoch()).count());
      query.bind(static_cast<std::int64_t>(keep));
      while (query.step()) names.push_back(query.text(0));
    }
    return names;
  });
}

Answer<std::vector<Reference>> SqliteJobStore::references() {
  return read<std::vector<Reference>>([](SqliteDatabase& database) -> Answer<std::vector<Reference>> {
    auto query = database.query(select_job_rows());
    std::vector<Reference> all;
    while (query.step())
      if (const auto row = read_job_row(query))
        for (std::string& digest : digests_of(row->record)) all.push_back({std::move(digest), row->record.job.owner()});
    return all;
  });
}

Answer<std::set<std::string>> SqliteJobStore::needed_digests() {
  return read<std::set<std::string>>([](SqliteDatabase& database) -> Answer<std::set<std::string>> {
    auto query = database.query(select_job_rows("WHERE ended IS NULL"));
    std::set<std::string> needed;
    while (query.step())
      if (const auto row = read_job_row(query)) add_needed(row->record, &needed);
    return needed;
  });
}

// ===== calls of workers =====

std::map<std::string, int> SqliteJobStore::waiting_peers(SqliteDatabase& database) const {
  const int most = transitions_.settings().max_running_of_peer;
  std::map<std::string, int> waiting;
  for (const std::string& peer : values_of(database, "peer", "state = 1")) waiting[peer] = 0;
  auto running = database.query("SELECT peer, COUNT(*) FROM jobs WHERE worker <> '' GROUP BY peer");
  while (running.step()) {
    const auto found = waiting.find(running.text(0));
    if (found == waiting.end()) continue;
    found->second = static_cast<int>(running.number(1));
    if (most > 0 && !found->first.empty() && found->second >= most) waiting.erase(found);
  }
  return waiting;
}

Answer<std::optional<Claimed>> SqliteJobStore::claim(const std::string& worker) {
  using Result = std::optional<Claimed>;
  // The queue is usually empty, and then nothing is written.
  const auto waiting = counts();
  if (!waiting) return tl::unexpected(waiting.error());
  if (waiting->pending == 0) return Result();
  return write<Result>([&](SqliteDatabase& database) -> Answer<Result> {
    auto waiting_of = waiting_peers(database);
    while (const std::string* const next = turns_.next(waiting_of)) {
      const std::string peer = *next;
      turns_.take(peer);
      waiting_of.erase(peer);
      auto query = database.query(select_job_rows("WHERE state = 1 AND peer = ? ORDER BY turn, jobs.key LIMIT 1"));
      if (!query.bind(peer).step()) continue;  // the index is damaged
      auto row = read_job_row(query);
      if (!row) {
        set_aside(database, query.number(0));
        return Result();  // the next call finds the next job
      }
      Changed changed = transitions_.claim(row->record, worker);
      save_job(database, *row);
      save_events(database, row->key, changed);
      return Claimed{claim_of(row->record), std::move(changed.events)};
    }
    return Result();
  });
}

Answer<bool> SqliteJobStore::renew_lease(const Claim& claim) {
  return write<bool>(claim, [this](JobRecord& record) {
    transitions_.renew(record);
    return record.job.state() == v1::JOB_STATE_CANCELLING;
  });
}

Answer<void> SqliteJobStore::note_progress(const Claim& claim, const v1::Iteration& iteration,
                                           std::int64_t last_sequence) {
  return write<bool>(claim,
                     [&](JobRecord& record) {
                       transitions_.note_progress(record, iteration, last_sequence);
                       return true;
                     })
      .map([](bool) {});
}

Answer<Changed> SqliteJobStore::note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) {
  return write<Changed>(claim, [&](JobRecord& record) { return transitions_.note_checkpoint(record, checkpoint); });
}

Answer<Changed> SqliteJobStore::finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) {
  return write<Changed>(claim, [&](JobRecord& record) { return transitions_.finish(record, ending, last_sequence); });
}

Answer<std::vector<Changed>> SqliteJobStore::take_back(const std::string& worker,
                                                       const std::set<std::string>& running) {
  using Result = std::vector<Changed>;
  const auto claimed = counts();
  if (!claimed) return tl::unexpected(claimed.error());
  if (claimed->running == 0) return Result();
  return write<Result>([&](SqliteDatabase& database) -> Answer<Result> {
    std::vector<JobRow> rows;
    std::vector<std::int64_t> damaged;
    {
      auto query = database.query(select_job_rows("WHERE worker <> ''"));
      while (query.step()) {
        if (auto row = read_job_row(query))
          rows.push_back(std::move(*row));
        else
          damaged.push_back(query.number(0));
      }
    }
    for (const std::int64_t key : damaged) set_aside(database, key);
    Result all;
    for (JobRow& row : rows) {
      if (!transitions_.is_lost(row.record, worker, running)) continue;
      all.push_back(transitions_.take_back(row.record));
      save_job(database, row);
      save_events(database, row.key, all.back());
    }
    return all;
  });
}

}  // namespace varimesh::server
