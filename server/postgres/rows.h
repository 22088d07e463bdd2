// The rows in which PostgresJobStore keeps jobs and their events.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/job_record.h"
#include "server/postgres/connection.h"
#include "server/postgres/transactions.h"

namespace varimesh::server::postgres {

/// A job's row: its key, which grows in the order of submission, and its record.
struct Row {
  std::int64_t key = 0;
  JobRecord record;
};

/// Returns "SELECT … FROM jobs JOIN specs", with the columns that read_row() reads. `rest` is the rest of the
/// statement, from WHERE on.
std::string select_rows(std::string_view rest = {});
/// DATA_LOSS if the row cannot be read.
Answer<Row> read_row(const PostgresRows& rows, int row);
/// The size of the job and its spec in the row.
std::size_t bytes_of(const PostgresRows& rows, int row);
/// Makes sure that nobody claims a job whose row is damaged. The row stays until the job is deleted.
void set_aside(PostgresConnection& connection, std::int64_t key);

enum class Lock { None, Row };
/// Returns the row of a job, and locks it if asked. NOT_FOUND (JOB_NOT_FOUND) if there is no such job; DATA_LOSS if its
/// row cannot be read.
Answer<Row> load(PostgresConnection& connection, const std::string& name, Lock lock);

/// Inserts a new job with its spec and labels, and sets the key of the row. Returns false, and inserts nothing, if
/// there is a job with the same owner and request id.
bool insert(PostgresConnection& connection, const Submission& submission, Row& row);
/// Writes the record of a row. The spec never changes and is not written again.
void save(PostgresConnection& connection, const Row& row);
/// Returns the events of a job, in order. DATA_LOSS if one cannot be read.
Answer<std::vector<v1::JobEvent>> load_events(PostgresConnection& connection, const Row& row);
/// The news that a job waits, and the beginnings of the news that a job is to be cancelled and that it has new events;
/// its name follows.
inline constexpr char kQueueNews[] = "queue", kCancelNews[] = "cancel ", kChangedNews[] = "changed ";
/// Stores the events of a change, and tells the other processes once the transaction is committed.
void save_events(PostgresWork& work, std::int64_t key, const Changed& changed);
/// Tells the news to all processes that listen. They are hints, so the database does not wait for its disk.
void notify(PostgresConnection& connection, const std::set<std::string>& news);

}  // namespace varimesh::server::postgres
