// The rows in which a job store keeps jobs and their events, in either database.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/job_database.h"

namespace varimesh::server {

/// A job's row: its key, which grows in the order of submission, and its record.
struct JobRow {
  std::int64_t key = 0;
  JobRecord record;
};

/// Returns "SELECT … FROM jobs JOIN specs", with the columns that read_job() reads. `rest` is the rest of the
/// statement, from WHERE on.
std::string select_jobs(const Sql& sql, std::string_view rest = {});
/// Returns a row of select_jobs(). DATA_LOSS if the row cannot be read, or if its check sum shows that it is not what
/// was saved: flipped bits can give a record that looks right.
Answer<JobRow> read_job(const Sql& sql, const SqlRow& row);
/// The size of the job and its spec in a row of select_jobs().
std::size_t bytes_of_job(const SqlRow& row);

/// Returns the row of a job. With `lock`, it is about to be changed. NOT_FOUND (JOB_NOT_FOUND) if there is no such job;
/// DATA_LOSS if its row is damaged.
Answer<JobRow> load_job(Sql& sql, const std::string& name, bool lock = false);
/// Returns the events of a job, in order. DATA_LOSS if one is damaged.
Answer<std::vector<v1::JobEvent>> load_events(Sql& sql, const JobRow& row);

/// Inserts a new job with its spec, labels and events, and sets the key of the row. Returns false, and inserts nothing,
/// if there is a job with the same owner and request id.
bool insert_job(JobWork& work, const Submission& submission, JobRow& row, const Changed& changed);
/// Writes the record of a row, and the events of its change. The spec never changes and is not written again.
void save_job(JobWork& work, const JobRow& row, const Changed& changed = {});
/// Makes sure that nobody claims a job whose row is damaged. The row stays until the job is deleted.
void set_aside(Sql& sql, std::int64_t key);
/// Deletes a job with its spec, labels and events.
void delete_job(Sql& sql, std::int64_t key);
/// Writes the check sums of rows that older versions have written without them.
void add_sums(Sql& sql);

}  // namespace varimesh::server
