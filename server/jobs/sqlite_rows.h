// The rows in which SqliteJobStore keeps jobs and their events.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/job_record.h"
#include "server/jobs/sqlite.h"

namespace varimesh::server {

/// A job's row: its key, which grows in the order of submission, and its record.
struct JobRow {
  std::int64_t key = 0;
  JobRecord record;
};

/// Returns "SELECT … FROM jobs JOIN specs", with the columns that read_job_row() reads. `rest` is the rest of the
/// statement, from WHERE on.
std::string select_job_rows(std::string_view rest = {});
/// Returns the current row of a query made by select_job_rows(). DATA_LOSS if the row is not
/// what was saved: every row has a check sum, since flipped bits can give a record that looks right.
Answer<JobRow> read_job_row(const SqliteQuery& query);
/// Makes sure that nobody claims a job whose row is damaged. The row stays until the job is deleted.
void set_aside(SqliteDatabase& database, std::int64_t key);
/// Returns the row of a job. NOT_FOUND (JOB_NOT_FOUND) if there is no such job; DATA_LOSS if its row is damaged.
Answer<JobRow> load_job(SqliteDatabase& database, const std::string& name);

/// Returns the different values of a column of text of the jobs with a condition, in order. Steps from one to the next
/// in an index, however many jobs each has.
std::vector<std::string> values_of(SqliteDatabase& database, const std::string& column, const std::string& condition);

/// Inserts a new job with its spec and labels, and sets the key of the row.
void insert_job(SqliteDatabase& database, const Submission& submission, JobRow& row);
/// Writes the record of a row. The spec never changes and is not written again.
void save_job(SqliteDatabase& database, const JobRow& row);
/// Returns the events of a job, in order. DATA_LOSS if one is damaged.
Answer<std::vector<v1::JobEvent>> load_events(SqliteDatabase& database, const JobRow& row);
/// Stores the events of a change.
void save_events(SqliteDatabase& database, std::int64_t key, const Changed& changed);
/// Deletes a job with its spec, labels and events.
void delete_job(SqliteDatabase& database, std::int64_t key);
/// Writes the check sums of rows that older versions have written without them.
void add_sums(SqliteDatabase& database);

}  // namespace varimesh::server
