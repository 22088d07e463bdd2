// Reads and writes the rows of jobs.
#include "server/jobs/sqlite_rows.h"

#include "server/refusals.h"

namespace varimesh::server {
namespace {

std::int64_t nanoseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

TimePoint from_nanoseconds(std::int64_t count) {
  return TimePoint(std::chrono::duration_cast<TimePoint::duration>(std::chrono::nanoseconds(count)));
}

}  // namespace

// ===== reading =====

std::string select_job_rows(std::string_view rest) {
  return "SELECT jobs.key, token, lost, worker, lease_end, history, checkpoint, checkpoint_iteration, job, spec, "
         "furthest FROM jobs JOIN specs USING(key) " +
         std::string(rest);
}

JobRow read_job_row(const SqliteQuery& query) {
  JobRow row;
  row.key = query.number(0);
  row.record.token = query.number(1);
  row.record.lost = static_cast<int>(query.number(2));
  row.record.worker = query.text(3);
  row.record.lease_end = from_nanoseconds(query.number(4));
  row.record.history_digest = query.text(5);
  if (!query.is_null(6)) row.record.checkpoint = {query.text(6), static_cast<int>(query.number(7))};
  parse_stored(query.view(8), &row.record.job);
  parse_stored(query.view(9), row.record.job.mutable_spec());
  row.record.furthest = static_cast<int>(query.number(10));
  return row;
}

Answer<JobRow> load_job(SqliteDatabase& database, const std::string& name) {
  auto query = database.query(select_job_rows("WHERE name = ?"));
  query.bind(name);
  if (!query.step()) return job_not_found(name);
  return read_job_row(query);
}

// ===== writing =====

void insert_job(SqliteDatabase& database, const Submission& submission, JobRow& row) {
  auto insert = database.query(
      "INSERT INTO jobs(name, request_id, state, turn, token, lost, worker, lease_end, history, "
      "checkpoint_iteration, job, owner) VALUES(?, ?, 0, ?, 0, 0, '', 0, '', 0, x'', ?)");
  insert.bind(submission.name);
  if (submission.request_id.empty())
    insert.bind_null();
  else
    insert.bind(submission.request_id);
  insert.bind(turn_of(row.record.job)).bind(submission.owner).run();
  row.key = database.last_key();
  const std::string spec = submission.spec.SerializeAsString();
  database.query("INSERT INTO specs VALUES(?, ?)").bind(row.key).bind(SqliteBytes{spec}).run();
  for (const auto& [name, value] : submission.spec.labels())
    database.query("INSERT INTO labels VALUES(?, ?, ?)").bind(name).bind(value).bind(row.key).run();
}

void save_job(SqliteDatabase& database, const JobRow& row) {
  const JobRecord& record = row.record;
  v1::Job job = record.job;
  job.clear_spec();
  const std::string bytes = job.SerializeAsString();
  auto query = database.query(
      "UPDATE jobs SET state = ?, ended = ?, token = ?, lost = ?, worker = ?, lease_end = ?, history = ?, "
      "checkpoint = ?, checkpoint_iteration = ?, furthest = ?, job = ? WHERE key = ?");
  query.bind(job.state());
  if (has_ended(job.state()))
    query.bind(job.end_time().seconds() * 1'000'000'000 + job.end_time().nanos());
  else
    query.bind_null();
  query.bind(record.token).bind(record.lost).bind(record.worker).bind(nanoseconds(record.lease_end));
  query.bind(record.history_digest);
  if (record.checkpoint)
    query.bind(record.checkpoint->digest).bind(record.checkpoint->iteration);
  else
    query.bind_null().bind(0);
  query.bind(record.furthest).bind(SqliteBytes{bytes}).bind(row.key).run();
}

void save_events(SqliteDatabase& database, std::int64_t key, const Changed& changed) {
  for (const v1::JobEvent& event : changed.events) {
    const std::string bytes = event.SerializeAsString();
    database.query("INSERT INTO events VALUES(?, ?, ?)")
        .bind(key)
        .bind(event.sequence())
        .bind(SqliteBytes{bytes})
        .run();
  }
}

void delete_job(SqliteDatabase& database, std::int64_t key) {
  for (const char* statement : {"DELETE FROM events WHERE key = ?", "DELETE FROM labels WHERE key = ?",
                                "DELETE FROM specs WHERE key = ?", "DELETE FROM jobs WHERE key = ?"})
    database.query(statement).bind(key).run();
}

}  // namespace varimesh::server
