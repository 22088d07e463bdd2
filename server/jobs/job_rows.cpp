// Reads and writes the rows of jobs.
#include "server/jobs/job_rows.h"

#include <algorithm>
#include <utility>

#include "core/base/sha256.h"
#include "server/jobs/timestamps.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// The columns of select_jobs(), in their order. The last ones are there only with check sums, or only without.
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
  Trace,
  CallDue,
  CancelUnseen,
  State = CancelUnseen,
  Owner,
  JobSum,
  SpecSum
};

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
  if (record.call_due) sum.add(nanoseconds(*record.call_due));
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
  return data_lost(
      "The record of " + what +
      " is damaged; ask the server's operator to check the disk of its database, delete the job and submit "
      "it again.");
}

/// Whether a job can have this name. PostgreSQL answers with an error to text with a zero byte or that is not UTF-8.
bool can_be_name(std::string_view name) {
  return name.starts_with("jobs/") &&
         std::all_of(name.begin(), name.end(), [](char letter) { return letter > ' ' && letter <= '~'; });
}

/// Reads the row; the check sums are not compared. Returns false if a message cannot be parsed.
bool read_columns(const SqlRow& from, JobRow* row) {
  row->key = from.number(Key);
  JobRecord& record = row->record;
  record.token = from.number(Token);
  record.lost = static_cast<int>(from.number(Lost));
  record.worker = from.text(Worker);
  record.lease_end = from_nanoseconds(from.number(LeaseEnd));
  record.history_digest = from.text(History);
  if (!from.is_null(Checkpoint))
    record.checkpoint = {from.text(Checkpoint), static_cast<int>(from.number(CheckpointIteration))};
  record.furthest = static_cast<int>(from.number(Furthest));
  record.peer = from.text(Peer);
  record.trace = from.text(Trace);
  if (!from.is_null(CallDue)) record.call_due = from_nanoseconds(from.number(CallDue));
  return parse(from.view(Job), &record.job) && parse(from.view(Spec), record.job.mutable_spec());
}

/// The bytes in which a job is kept, without its spec.
std::string bytes_of(v1::Job job) {
  job.clear_spec();
  return job.SerializeAsString();
}

/// Adds the columns that change with the record. `job`: its bytes.
void add_record(SqlValues& values, const JobRecord& record, const std::string& job) {
  values.add(record.job.state());
  if (has_ended(record.job.state()))
    values.add(nanoseconds(time_point(record.job.end_time())));
  else
    values.add_null();
  values.add(record.token).add(record.lost).add(record.furthest).add(record.worker);
  values.add(nanoseconds(record.lease_end)).add(record.history_digest);
  if (record.checkpoint)
    values.add(record.checkpoint->digest).add(record.checkpoint->iteration);
  else
    values.add_null().add(std::int64_t{0});
  values.add_bytes(job);
}

void save_events(JobWork& work, std::int64_t key, const Changed& changed) {
  const bool sums = work.sql.dialect().sums;
  if (!changed.events.empty()) work.news.push_back({News::Kind::Changed, changed.job.name()});
  for (const v1::JobEvent& event : changed.events) {
    if (event.state_change().state() == v1::JOB_STATE_PENDING) work.news.push_back({News::Kind::Queue, {}});
    const std::string bytes = event.SerializeAsString();
    SqlValues values;
    values.add(key).add(event.sequence()).add_bytes(bytes);
    if (sums) values.add(sum_of_event(key, event.sequence(), bytes));
    work.sql.ask(sums ? "INSERT INTO events VALUES($1, $2, $3, $4)" : "INSERT INTO events VALUES($1, $2, $3)", values);
  }
}

}  // namespace

// ===== reading =====

std::string select_jobs(const Sql& sql, std::string_view rest) {
  const std::string columns =
      "SELECT jobs.key, token, lost, worker, lease_end, history, checkpoint, checkpoint_iteration, job, spec, "
      "furthest, "
      "peer, trace, call_due, ";
  return columns + (sql.dialect().sums ? "state, owner, jobs.sum, specs.sum" : "cancel_unseen::integer") +
         " FROM jobs JOIN specs ON specs.key = jobs.key " + std::string(rest);
}

Answer<JobRow> read_job(const Sql& sql, const SqlRow& from) {
  JobRow row;
  bool good = read_columns(from, &row);
  if (!sql.dialect().sums) {
    row.record.cancel_unseen = from.number(CancelUnseen) != 0;
  } else {
    // The check sum covers the owner in the record, but lists are made by the column.
    good = good && from.number(State) == row.record.job.state() && from.view(Owner) == row.record.job.owner() &&
           from.number(JobSum) == sum_of_job(row, from.view(Job)) &&
           from.number(SpecSum) == sum_of_spec(row.key, from.view(Spec));
  }
  if (!good) return damaged("a job (row " + std::to_string(row.key) + " of the database)");
  return row;
}

std::size_t bytes_of_job(const SqlRow& row) { return row.view(Job).size() + row.view(Spec).size(); }

Answer<JobRow> load_job(Sql& sql, const std::string& name, bool lock) {
  Answer<JobRow> found = job_not_found(name);
  if (!can_be_name(name)) return found;
  sql.ask(select_jobs(sql, std::string("WHERE name = $1") + (lock ? sql.dialect().lock : "")), SqlValues().add(name),
          [&](const SqlRow& row) { found = read_job(sql, row); });
  if (found && found->record.job.name() != name) return damaged(name);
  return found;
}

Answer<std::vector<v1::JobEvent>> load_events(Sql& sql, const JobRow& job) {
  const bool sums = sql.dialect().sums;
  std::vector<v1::JobEvent> events;
  Answer<void> read;
  sql.ask(sums ? "SELECT event, sequence, sum FROM events WHERE key = $1 ORDER BY sequence"
               : "SELECT event, sequence FROM events WHERE key = $1 ORDER BY sequence",
          SqlValues().add(job.key), [&](const SqlRow& row) {
            const std::int64_t sequence = row.number(1);
            if (!parse(row.view(0), &events.emplace_back()) ||
                (sums && row.number(2) != sum_of_event(job.key, sequence, row.view(0))))
              read = damaged("event " + std::to_string(sequence) + " of " + job.record.job.name());
          });
  if (!read) return tl::unexpected(read.error());
  return events;
}

// ===== writing =====

bool insert_job(JobWork& work, const Submission& submission, JobRow& row, const Changed& changed) {
  Sql& sql = work.sql;
  const bool sums = sql.dialect().sums;
  const std::string job = bytes_of(row.record.job), spec = submission.spec.SerializeAsString();
  SqlValues values;
  values.add(submission.name).add(submission.owner).add(submission.peer).add(submission.trace);
  values.add(turn_of(row.record.job));
  if (submission.request_id.empty())
    values.add_null();
  else
    values.add(submission.request_id);
  add_record(values, row.record, job);
  values.add(std::int64_t{submission.needs_device});
  row.key = sql.number(
      "INSERT INTO jobs(name, owner, peer, trace, turn, request_id, state, ended, token, lost, furthest, worker, "
      "lease_end, history, checkpoint, checkpoint_iteration, job, needs_device) VALUES($1, $2, $3, $4, $5, $6, $7, $8, "
      "$9, $10, $11, $12, $13, $14, $15, $16, $17, $18) ON CONFLICT(owner, request_id) DO NOTHING RETURNING key",
      values);
  if (row.key == 0) return false;
  if (sums) sql.ask("UPDATE jobs SET sum = $2 WHERE key = $1", SqlValues().add(row.key).add(sum_of_job(row, job)));
  SqlValues of_spec;
  of_spec.add(row.key).add_bytes(spec);
  if (sums) of_spec.add(sum_of_spec(row.key, spec));
  sql.ask(sums ? "INSERT INTO specs VALUES($1, $2, $3)" : "INSERT INTO specs VALUES($1, $2)", of_spec);
  for (const auto& [name, value] : submission.spec.labels())
    sql.ask("INSERT INTO labels VALUES($1, $2, $3)", SqlValues().add(name).add(value).add(row.key));
  save_events(work, row.key, changed);
  return true;
}

void save_job(JobWork& work, const JobRow& row, const Changed& changed) {
  const bool sums = work.sql.dialect().sums;
  const std::string job = bytes_of(row.record.job);
  SqlValues values;
  values.add(row.key);
  add_record(values, row.record, job);
  values.add(sums ? sum_of_job(row, job) : std::int64_t{row.record.cancel_unseen});
  if (row.record.call_due)
    values.add(nanoseconds(*row.record.call_due));
  else
    values.add_null();
  work.sql.ask(std::string("UPDATE jobs SET state = $2, ended = $3, token = $4, lost = $5, furthest = $6, worker = $7, "
                           "lease_end = $8, history = $9, checkpoint = $10, checkpoint_iteration = $11, job = $12, ") +
                   (sums ? "sum = $13" : "cancel_unseen = $13::integer::boolean") + ", call_due = $14 WHERE key = $1",
               values);
  save_events(work, row.key, changed);
}

void set_aside(Sql& sql, std::int64_t key) {
  sql.ask("UPDATE jobs SET state = 0, worker = '', call_due = NULL WHERE key = $1", SqlValues().add(key));
}

void delete_job(Sql& sql, std::int64_t key) {
  for (const char* const table : {"events", "labels", "specs", "jobs"})
    sql.ask(std::string("DELETE FROM ") + table + " WHERE key = $1", SqlValues().add(key));
}

void add_sums(Sql& sql) {
  const auto update = [&](const char* statement, std::int64_t key, std::int64_t sum) {
    sql.ask(statement, SqlValues().add(key).add(sum));
  };
  sql.ask(select_jobs(sql), {}, [&](const SqlRow& from) {
    JobRow row;
    if (!read_columns(from, &row)) return;  // without its sum the row counts as damaged
    update("UPDATE jobs SET sum = $2 WHERE key = $1", row.key, sum_of_job(row, from.view(Job)));
    update("UPDATE specs SET sum = $2 WHERE key = $1", row.key, sum_of_spec(row.key, from.view(Spec)));
  });
  sql.ask("SELECT key, sequence, event FROM events", {}, [&](const SqlRow& from) {
    const std::int64_t sum = sum_of_event(from.number(0), from.number(1), from.view(2));
    sql.ask("UPDATE events SET sum = $3 WHERE key = $1 AND sequence = $2",
            SqlValues().add(from.number(0)).add(from.number(1)).add(sum));
  });
}

}  // namespace varimesh::server
