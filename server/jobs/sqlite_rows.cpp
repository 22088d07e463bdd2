// Reads and writes the rows of jobs.
#include "server/jobs/sqlite_rows.h"

#include "core/base/sha256.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

std::int64_t nanoseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

TimePoint from_nanoseconds(std::int64_t count) {
  return TimePoint(std::chrono::duration_cast<TimePoint::duration>(std::chrono::nanoseconds(count)));
}

/// The check sum of a row: the first 8 bytes of the SHA-256 of its columns, each with its length.
class Sum {
 public:
  Sum& add(std::string_view bytes) {
    add(static_cast<std::int64_t>(bytes.size()));
    bytes_ += bytes;
    return *this;
  }
  Sum& add(std::int64_t number) {
    bytes_ += std::to_string(number) + ' ';
    return *this;
  }
  std::int64_t value() const {
    return static_cast<std::int64_t>(std::stoull(sha256(bytes_).substr(0, 16), nullptr, 16));
  }

 private:
  std::string bytes_;
};

std::int64_t sum_of_job(const JobRow& row, std::string_view job_bytes) {
  const JobRecord& record = row.record;
  Sum sum;
  sum.add(row.key).add(static_cast<std::int64_t>(record.job.state())).add(record.token).add(record.lost);
  sum.add(record.worker).add(nanoseconds(record.lease_end)).add(record.history_digest).add(record.furthest);
  if (record.checkpoint) sum.add(record.checkpoint->digest).add(record.checkpoint->iteration);
  return sum.add(job_bytes).value();
}

std::int64_t sum_of_spec(std::int64_t key, std::string_view spec) { return Sum().add(key).add(spec).value(); }

std::int64_t sum_of_event(std::int64_t key, std::int64_t sequence, std::string_view event) {
  return Sum().add(key).add(sequence).add(event).value();
}

template <class Message>
bool parse(std::string_view bytes, Message* message) {
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

Refusal damaged(const std::string& what) {
  return data_lost("The record of " + what +
                   " is damaged; ask the server's operator to check its disk, delete the job and submit it again.");
}

/// Reads the row; the check sums are not compared. Returns false if a message cannot be parsed.
bool read_columns(const SqliteQuery& query, JobRow* row) {
  row->key = query.number(0);
  row->record.token = query.number(1);
  row->record.lost = static_cast<int>(query.number(2));
  row->record.worker = query.text(3);
  row->record.lease_end = from_nanoseconds(query.number(4));
  row->record.history_digest = query.text(5);
  if (!query.is_null(6)) row->record.checkpoint = {query.text(6), static_cast<int>(query.number(7))};
  row->record.furthest = static_cast<int>(query.number(10));
  row->record.peer = query.text(14);
  row->record.trace = query.text(16);
  return parse(query.view(8), &row->record.job) && parse(query.view(9), row->record.job.mutable_spec());
}

}  // namespace

// ===== reading =====

std::string select_job_rows(std::string_view rest) {
  return "SELECT jobs.key, token, lost, worker, lease_end, history, checkpoint, checkpoint_iteration, job, spec, "
         "furthest, state, jobs.sum, specs.sum, peer, owner, trace FROM jobs JOIN specs USING(key) " +
         std::string(rest);
}

Answer<JobRow> read_job_row(const SqliteQuery& query) {
  JobRow row;
  // The check sum covers the owner in the record, but lists are made by the column.
  const bool good = read_columns(query, &row) && query.number(11) == row.record.job.state() &&
                    query.view(15) == row.record.job.owner() && query.number(12) == sum_of_job(row, query.view(8)) &&
                    query.number(13) == sum_of_spec(row.key, query.view(9));
  if (!good) return damaged("a job (row " + std::to_string(row.key) + " of the database)");
  return row;
}

void set_aside(SqliteDatabase& database, std::int64_t key) {
  database.query("UPDATE jobs SET state = 0, worker = '' WHERE key = ?").bind(key).run();
}

Answer<JobRow> load_job(SqliteDatabase& database, const std::string& name) {
  auto query = database.query(select_job_rows("WHERE name = ?"));
  query.bind(name);
  if (!query.step()) return job_not_found(name);
  auto row = read_job_row(query);
  if (row && row->record.job.name() != name) return damaged(name);
  return row;
}

Answer<std::vector<v1::JobEvent>> load_events(SqliteDatabase& database, const JobRow& row) {
  auto query = database.query("SELECT event, sequence, sum FROM events WHERE key = ? ORDER BY sequence");
  query.bind(row.key);
  std::vector<v1::JobEvent> events;
  while (query.step()) {
    const std::int64_t sequence = query.number(1);
    if (!parse(query.view(0), &events.emplace_back()) ||
        query.number(2) != sum_of_event(row.key, sequence, query.view(0)))
      return damaged("event " + std::to_string(sequence) + " of " + row.record.job.name());
  }
  return events;
}

std::vector<std::string> values_of(SqliteDatabase& database, const std::string& column, const std::string& condition) {
  const std::string least = "SELECT MIN(" + column + ") FROM jobs WHERE " + condition;
  auto query =
      database.query("WITH RECURSIVE found(value) AS (" + least + " UNION ALL SELECT (" + least + " AND " + column +
                     " > found.value) FROM found WHERE found.value IS NOT NULL) "
                     "SELECT value FROM found WHERE value IS NOT NULL");
  std::vector<std::string> values;
  while (query.step()) values.push_back(query.text(0));
  return values;
}

// ===== writing =====

void insert_job(SqliteDatabase& database, const Submission& submission, JobRow& row) {
  auto insert = database.query(
      "INSERT INTO jobs(name, request_id, state, turn, token, lost, worker, lease_end, history, "
      "checkpoint_iteration, job, peer, owner, trace) VALUES(?, ?, 0, ?, 0, 0, '', 0, '', 0, x'', ?, ?, ?)");
  insert.bind(submission.name);
  if (submission.request_id.empty())
    insert.bind_null();
  else
    insert.bind(submission.request_id);
  insert.bind(turn_of(row.record.job)).bind(submission.peer).bind(submission.owner).bind(submission.trace).run();
  row.key = database.last_key();
  const std::string spec = submission.spec.SerializeAsString();
  database.query("INSERT INTO specs VALUES(?, ?, ?)")
      .bind(row.key)
      .bind(SqliteBytes{spec})
      .bind(sum_of_spec(row.key, spec))
      .run();
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
      "checkpoint = ?, checkpoint_iteration = ?, furthest = ?, job = ?, sum = ? WHERE key = ?");
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
  query.bind(record.furthest).bind(SqliteBytes{bytes}).bind(sum_of_job(row, bytes)).bind(row.key).run();
}

void save_events(SqliteDatabase& database, std::int64_t key, const Changed& changed) {
  for (const v1::JobEvent& event : changed.events) {
    const std::string bytes = event.SerializeAsString();
    database.query("INSERT INTO events VALUES(?, ?, ?, ?)")
        .bind(key)
        .bind(event.sequence())
        .bind(SqliteBytes{bytes})
        .bind(sum_of_event(key, event.sequence(), bytes))
        .run();
  }
}

void delete_job(SqliteDatabase& database, std::int64_t key) {
  for (const char* statement : {"DELETE FROM events WHERE key = ?", "DELETE FROM labels WHERE key = ?",
                                "DELETE FROM specs WHERE key = ?", "DELETE FROM jobs WHERE key = ?"})
    database.query(statement).bind(key).run();
}

void add_sums(SqliteDatabase& database) {
  const auto update = [&](const char* statement, std::int64_t sum, std::int64_t key) {
    database.query(statement).bind(sum).bind(key).run();
  };
  auto jobs = database.query(select_job_rows());
  while (jobs.step()) {
    JobRow row;
    if (!read_columns(jobs, &row)) continue;  // without its sum the row counts as damaged
    update("UPDATE jobs SET sum = ? WHERE key = ?", sum_of_job(row, jobs.view(8)), row.key);
    update("UPDATE specs SET sum = ? WHERE key = ?", sum_of_spec(row.key, jobs.view(9)), row.key);
  }
  auto events = database.query("SELECT key, sequence, event FROM events");
  while (events.step())
    database.query("UPDATE events SET sum = ? WHERE key = ? AND sequence = ?")
        .bind(sum_of_event(events.number(0), events.number(1), events.view(2)))
        .bind(events.number(0))
        .bind(events.number(1))
        .run();
}

}  // namespace varimesh::server
