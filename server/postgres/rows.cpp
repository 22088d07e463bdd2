// Reads and writes the rows of jobs.
#include "server/postgres/rows.h"

#include <algorithm>

#include "server/refusals.h"

namespace varimesh::server::postgres {
namespace {

/// The columns of select_rows(), in their order.
enum Column {
  Key,
  Token,
  Lost,
  Worker,
  LeaseEnd,
  History,
  Checkpoint,
  CheckpointIteration,
  Job,
  Spec,
  Furthest,
  Peer,
  CancelUnseen,
  Trace
};

std::int64_t nanoseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

template <class Message>
bool parse(std::string_view bytes, Message* message) {
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

Refusal damaged(const std::string& what) {
  return data_lost("The record of " + what +
                   " is damaged; ask the server's operator to check its database, delete the job and submit it again.");
}

/// Whether a job can have this name. PostgreSQL answers with an error to text with a zero byte or that is not UTF-8.
bool can_be_name(std::string_view name) {
  return name.starts_with("jobs/") &&
         std::all_of(name.begin(), name.end(), [](char letter) { return letter > ' ' && letter <= '~'; });
}

/// Adds the values of everything that save() writes.
void add_record(PostgresValues& values, const JobRecord& record) {
  v1::Job job = record.job;
  job.clear_spec();
  values.add(job.state());
  if (has_ended(job.state()))
    values.add(job.end_time().seconds() * 1'000'000'000 + job.end_time().nanos());
  else
    values.add_null();
  values.add(record.token).add(record.lost).add(record.furthest).add(record.worker);
  values.add(nanoseconds(record.lease_end)).add(record.history_digest);
  if (record.checkpoint)
    values.add(record.checkpoint->digest).add(record.checkpoint->iteration);
  else
    values.add_null().add(std::int64_t{0});
  values.add(std::int64_t{record.cancel_unseen}).add(job.SerializeAsString());
}

}  // namespace

// ===== reading =====

std::string select_rows(std::string_view rest) {
  return "SELECT jobs.key, token, lost, worker, lease_end, history, checkpoint, checkpoint_iteration, job, spec, "
         "furthest, peer, cancel_unseen::integer, trace FROM jobs JOIN specs ON specs.key = jobs.key " +
         std::string(rest);
}

Answer<Row> read_row(const PostgresRows& rows, int at) {
  Row row;
  row.key = rows.number(at, Key);
  JobRecord& record = row.record;
  record.token = rows.number(at, Token);
  record.lost = static_cast<int>(rows.number(at, Lost));
  record.worker = rows.text(at, Worker);
  record.lease_end =
      TimePoint(std::chrono::duration_cast<TimePoint::duration>(std::chrono::nanoseconds(rows.number(at, LeaseEnd))));
  record.history_digest = rows.text(at, History);
  if (!rows.is_null(at, Checkpoint))
    record.checkpoint = {rows.text(at, Checkpoint), static_cast<int>(rows.number(at, CheckpointIteration))};
  record.furthest = static_cast<int>(rows.number(at, Furthest));
  record.peer = rows.text(at, Peer);
  record.cancel_unseen = rows.number(at, CancelUnseen) != 0;
  record.trace = rows.text(at, Trace);
  if (!parse(rows.view(at, Job), &record.job) || !parse(rows.view(at, Spec), record.job.mutable_spec()))
    return damaged("a job (row " + std::to_string(row.key) + " of the database)");
  return row;
}

std::size_t bytes_of(const PostgresRows& rows, int row) {
  return rows.view(row, Job).size() + rows.view(row, Spec).size();
}

void set_aside(PostgresConnection& connection, std::int64_t key) {
  connection.query("UPDATE jobs SET state = 0, worker = '' WHERE key = $1", PostgresValues().add(key));
}

Answer<Row> load(PostgresConnection& connection, const std::string& name, Lock lock) {
  if (!can_be_name(name)) return job_not_found(name);
  const PostgresRows rows =
      connection.query(select_rows(lock == Lock::Row ? "WHERE name = $1 FOR UPDATE OF jobs" : "WHERE name = $1"),
                       PostgresValues().add(name));
  if (rows.count() == 0) return job_not_found(name);
  auto row = read_row(rows, 0);
  if (row && row->record.job.name() != name) return damaged(name);
  return row;
}

Answer<std::vector<v1::JobEvent>> load_events(PostgresConnection& connection, const Row& row) {
  const PostgresRows rows = connection.query("SELECT event, sequence FROM events WHERE key = $1 ORDER BY sequence",
                                             PostgresValues().add(row.key));
  std::vector<v1::JobEvent> events(static_cast<std::size_t>(rows.count()));
  for (int i = 0; i < rows.count(); ++i)
    if (!parse(rows.view(i, 0), &events[static_cast<std::size_t>(i)]))
      return damaged("event " + std::to_string(rows.number(i, 1)) + " of " + row.record.job.name());
  return events;
}

// ===== writing =====

bool insert(PostgresConnection& connection, const Submission& submission, Row& row) {
  PostgresValues values;
  values.add(submission.name);
  if (submission.request_id.empty())
    values.add_null();
  else
    values.add(submission.request_id);
  values.add(submission.owner).add(submission.peer).add(turn_of(row.record.job));
  add_record(values, row.record);
  values.add(submission.trace);
  const PostgresRows inserted = connection.query(
      "INSERT INTO jobs(name, request_id, owner, peer, turn, state, ended, token, lost, furthest, worker, lease_end, "
      "history, checkpoint, checkpoint_iteration, cancel_unseen, job, trace) "
      "VALUES($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16::integer::boolean, $17, $18) "
      "ON CONFLICT(owner, request_id) DO NOTHING RETURNING key",
      values);
  if (inserted.count() == 0) return false;
  row.key = inserted.number(0, 0);
  connection.query("INSERT INTO specs VALUES($1, $2)",
                   PostgresValues().add(row.key).add(submission.spec.SerializeAsString()));
  for (const auto& [name, value] : submission.spec.labels())
    connection.query("INSERT INTO labels VALUES($1, $2, $3)", PostgresValues().add(name).add(value).add(row.key));
  return true;
}

void save(PostgresConnection& connection, const Row& row) {
  PostgresValues values;
  values.add(row.key);
  add_record(values, row.record);
  connection.query(
      "UPDATE jobs SET state = $2, ended = $3, token = $4, lost = $5, furthest = $6, worker = $7, lease_end = $8, "
      "history = $9, checkpoint = $10, checkpoint_iteration = $11, cancel_unseen = $12::integer::boolean, job = $13 "
      "WHERE key = $1",
      values);
}

void notify(PostgresConnection& connection, const std::set<std::string>& news) {
  std::string lines;
  for (const std::string& one : news) lines += (lines.empty() ? "" : "\n") + one;
  connection.query(
      "WITH quick AS (SELECT set_config('synchronous_commit', 'off', true)) "
      "SELECT pg_notify('varimesh', one) FROM quick, unnest(string_to_array($1::text, E'\\n')) AS one",
      PostgresValues().add(lines));
}

void save_events(PostgresWork& work, std::int64_t key, const Changed& changed) {
  if (!changed.events.empty()) work.news.insert(kChangedNews + changed.job.name());
  for (const v1::JobEvent& event : changed.events) {
    if (event.state_change().state() == v1::JOB_STATE_PENDING) work.news.insert(kQueueNews);
    work.connection.query("INSERT INTO events VALUES($1, $2, $3)",
                          PostgresValues().add(key).add(event.sequence()).add(event.SerializeAsString()));
  }
}

}  // namespace varimesh::server::postgres
