// The calls of clients. The rules are in jobs/job_record.cpp, and the rows in rows.cpp.
#include "server/postgres/postgres_job_store.h"

#include <algorithm>
#include <limits>

#include "core/base/sha256.h"
#include "server/jobs/timestamps.h"
#include "server/postgres/rows.h"
#include "server/postgres/schema.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using postgres::Lock;
using postgres::Row;

/// How many jobs may be missing from a count of waiting jobs that is not repeated for some seconds.
constexpr std::int64_t kCountMargin = 1000;

/// How many digests are asked for at once.
constexpr int kMostDigests = 1000;

}  // namespace

Answer<std::unique_ptr<PostgresJobStore>> PostgresJobStore::open(const PostgresSettings& where,
                                                                 const JobStoreSettings& settings) {
  std::unique_ptr<PostgresJobStore> store(new PostgresJobStore(where, settings));
  const auto version = store->database_.read<int>(
      [](PostgresConnection& connection) -> Answer<int> { return postgres_version(connection); });
  if (!version) return tl::unexpected(version.error());
  if (*version > kPostgresVersion) return postgres_too_new(*version);
  if (*version < kPostgresVersion)
    return internal_failure("The database has no tables of this version (theirs is " + std::to_string(*version) +
                            ", this program's is " + std::to_string(kPostgresVersion) +
                            "); run varimeshd migrate with the same --store first.");
  if (const auto checked = store->check_meshes(); !checked) return tl::unexpected(checked.error());
  return store;
}

Answer<void> PostgresJobStore::check_meshes() {
  const std::string& ours = database_.settings().meshes;
  if (ours.empty()) return {};
  const auto theirs = database_.write<std::string>([&](PostgresWork& transaction) -> Answer<std::string> {
    transaction.connection.query("INSERT INTO meshes(directory) VALUES($1::text) ON CONFLICT DO NOTHING",
                                 PostgresValues().add(ours));
    return transaction.connection.query("SELECT directory FROM meshes").text(0, 0);
  });
  if (!theirs) return tl::unexpected(theirs.error());
  if (*theirs == ours) return {};
  return internal_failure(
      "The jobs of this database have their meshes in another directory; start the server with that one (--meshes, or "
      "--state if no --meshes was given), or choose another database. After the meshes were restored to a new place, "
      "the file 'name' must be there too.");
}

bool PostgresJobStore::has_ample_room(int max_pending) {
  std::lock_guard lock(waiting_mutex_);
  // A count of a hundred thousand takes as long as several submissions, so far from the limit it serves for longer.
  const bool is_far = waiting_ < max_pending / 2;
  return counted_ && std::chrono::steady_clock::now() - *counted_ < std::chrono::seconds(is_far ? 10 : 1) &&
         waiting_ + kCountMargin < max_pending;
}

Answer<void> PostgresJobStore::check_room(PostgresConnection& connection, const Submission& submission) {
  const auto count_of_peer = [&] {
    return connection
        .query("SELECT count(*) FROM jobs WHERE state = 1 AND peer = $1", PostgresValues().add(submission.peer))
        .number(0, 0);
  };
  // With many waiting jobs the count takes milliseconds.
  if (!has_ample_room(submission.max_pending)) {
    const std::int64_t waiting = connection.query("SELECT count(*) FROM jobs WHERE state = 1").number(0, 0);
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

Answer<Changed> PostgresJobStore::submit(const Submission& submission) {
  return database_.write<Changed>(
      [&](PostgresWork& transaction) -> Answer<Changed> {
        PostgresConnection& connection = transaction.connection;
        const auto same_request = [&]() -> std::optional<Answer<Changed>> {
          if (submission.request_id.empty()) return std::nullopt;
          const PostgresRows rows = connection.query(postgres::select_rows("WHERE owner = $1 AND request_id = $2"),
                                                     PostgresValues().add(submission.owner).add(submission.request_id));
          if (rows.count() == 0) return std::nullopt;
          const auto row = postgres::read_row(rows, 0);
          if (!row) return tl::unexpected(row.error());
          if (const auto same = check_same(row->record.job, submission); !same) return tl::unexpected(same.error());
          return Changed{row->record.job, {}, {}};
        };
        if (const auto there = same_request()) return *there;
        if (const auto room = check_room(connection, submission); !room) return tl::unexpected(room.error());
        Row row;
        Changed changed = transaction.transitions.create(row.record, submission);
        if (!postgres::insert(connection, submission, row)) {
          if (const auto there = same_request()) return *there;
          return store_unavailable();  // that job was deleted at this moment
        }
        postgres::save_events(transaction, row.key, changed);
        std::lock_guard lock(waiting_mutex_);
        ++waiting_;
        return changed;
      },
      PostgresTransactions::Outcome::CanBeAskedAgain);
}

Answer<v1::Job> PostgresJobStore::get(const std::string& name) {
  return database_.read<v1::Job>([&](PostgresConnection& connection) {
    return postgres::load(connection, name, Lock::None).map([](Row&& row) { return std::move(row.record.job); });
  });
}

Answer<JobPage> PostgresJobStore::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  const auto below = parse_page_token(page_token);
  if (!below) return tl::unexpected(below.error());
  PostgresValues values;
  values.add(*below > 0 ? *below : std::numeric_limits<std::int64_t>::max()).add(std::int64_t{page_size} + 1);
  values.add(static_cast<std::int64_t>(std::min<std::size_t>(filter.most_bytes, std::size_t{1} << 62)));
  std::string where = "jobs.key < $1";
  std::string separator = " AND state IN (";
  for (const v1::JobState state : filter.states) {
    where += separator + std::to_string(static_cast<int>(state));
    separator = ", ";
  }
  if (!filter.states.empty()) where += ")";
  int parameter = 3;
  if (filter.owner) {
    values.add(*filter.owner);
    where += " AND owner = $" + std::to_string(++parameter) + "::bytea";
  }
  for (const auto& [name, value] : filter.labels) {
    values.add(name).add(value);
    where += " AND EXISTS(SELECT 1 FROM labels WHERE labels.key = jobs.key AND labels.name = $" +
             std::to_string(parameter + 1) + "::bytea AND value = $" + std::to_string(parameter + 2) + "::bytea)";
    parameter += 2;
  }
  // The page ends with the row that makes it too large, so that the database does not send more.
  const std::string statement = postgres::select_rows(
      "JOIN (SELECT key, sum(bytes) OVER (ORDER BY key DESC) - bytes AS bytes_before FROM (SELECT jobs.key, "
      "octet_length(job)::bigint + octet_length(spec) AS bytes FROM jobs JOIN specs ON specs.key = jobs.key WHERE " +
      where +
      " ORDER BY jobs.key DESC LIMIT $2) AS page) AS sums ON sums.key = jobs.key WHERE bytes_before <= $3 "
      "ORDER BY jobs.key DESC");

  return database_.read<JobPage>([&](PostgresConnection& connection) -> Answer<JobPage> {
    const PostgresRows rows = connection.query_once(statement, values);
    JobPage page;
    std::size_t bytes = 0;
    for (int i = 0; i < rows.count(); ++i) {
      bytes += postgres::bytes_of(rows, i);
      if (i == page_size || (bytes > filter.most_bytes && i > 0)) {
        page.next_page_token = std::to_string(rows.number(i - 1, 0));
        break;
      }
      if (auto row = postgres::read_row(rows, i)) page.jobs.push_back(std::move(row->record.job));  // no damaged ones
    }
    return page;
  });
}

Answer<JobCounts> PostgresJobStore::counts() {
  return database_.read<JobCounts>([](PostgresConnection& connection) -> Answer<JobCounts> {
    const PostgresRows rows = connection.query(
        "SELECT (SELECT count(*) FROM jobs WHERE state = 1), (SELECT count(*) FROM jobs WHERE worker <> '')");
    return JobCounts{static_cast<int>(rows.number(0, 0)), static_cast<int>(rows.number(0, 1))};
  });
}

Answer<std::optional<TimePoint>> PostgresJobStore::oldest_pending() {
  using Result = std::optional<TimePoint>;
  return database_.read<Result>([](PostgresConnection& connection) -> Answer<Result> {
    // Keys are in the order of submission.
    const PostgresRows rows =
        connection.query(postgres::select_rows("WHERE jobs.key = (SELECT min(key) FROM jobs WHERE state = 1)"));
    if (rows.count() == 0) return Result();
    const auto row = postgres::read_row(rows, 0);
    if (!row) return tl::unexpected(row.error());
    return Result(time_point(row->record.job.create_time()));
  });
}

Answer<std::vector<v1::JobEvent>> PostgresJobStore::events(const std::string& name) {
  return database_.read<std::vector<v1::JobEvent>>(
      [&](PostgresConnection& connection) -> Answer<std::vector<v1::JobEvent>> {
        const auto row = postgres::load(connection, name, Lock::None);
        if (!row) return tl::unexpected(row.error());
        return postgres::load_events(connection, *row);
      });
}

Answer<Changed> PostgresJobStore::request_cancel(const std::string& name, std::int64_t last_sequence) {
  return database_.write<Changed>(
      [&](PostgresWork& transaction) -> Answer<Changed> {
        auto row = postgres::load(transaction.connection, name, Lock::Row);
        if (!row) return tl::unexpected(row.error());
        Changed changed = transaction.transitions.cancel(row->record, last_sequence);
        if (changed.events.empty()) return changed;
        postgres::save(transaction.connection, *row);
        postgres::save_events(transaction, row->key, changed);
        return changed;
      },
      PostgresTransactions::Outcome::CanBeAskedAgain);
}

Answer<Changed> PostgresJobStore::ask_to_cancel(const std::string& name) {
  return database_.write<Changed>(
      [&](PostgresWork& transaction) -> Answer<Changed> {
        auto row = postgres::load(transaction.connection, name, Lock::Row);
        if (!row) return tl::unexpected(row.error());
        const v1::JobState before = row->record.job.state();
        Changed changed = transaction.transitions.ask_to_cancel(row->record);
        if (changed.job.state() == before) return changed;
        postgres::save(transaction.connection, *row);
        postgres::save_events(transaction, row->key, changed);
        if (row->record.cancel_unseen) transaction.news.insert(postgres::kCancelNews + name);
        return changed;
      },
      PostgresTransactions::Outcome::CanBeAskedAgain);
}

void PostgresJobStore::listen(std::function<void(const News&)> listener) {
  listener_.reset();
  if (listener) listener_ = std::make_unique<PostgresListener>(database_.where().url, std::move(listener));
}

Answer<std::string> PostgresJobStore::history_digest(const std::string& name) {
  return database_.read<std::string>([&](PostgresConnection& connection) {
    return postgres::load(connection, name, Lock::None).map([](const Row& row) { return row.record.history_digest; });
  });
}

Answer<Changed> PostgresJobStore::remove(const std::string& name) {
  return database_.write<Changed>(
      [&](PostgresWork& transaction) -> Answer<Changed> {
        const auto row = postgres::load(transaction.connection, name, Lock::Row);
        Changed changed;  // of a damaged row it is not known what the job refers to
        changed.job.set_name(name);
        if (!row && row.error().code != Failure::Code::DataLoss) return tl::unexpected(row.error());
        if (row && !has_ended(row->record.job.state())) return job_not_ended(name);
        if (row) changed = {row->record.job, {}, digests_of(row->record)};
        transaction.connection.query("DELETE FROM jobs WHERE name = $1", PostgresValues().add(name));
        return changed;
      },
      PostgresTransactions::Outcome::CanBeAskedAgain);
}

Answer<std::vector<std::string>> PostgresJobStore::ended_beyond(std::size_t keep, TimePoint before) {
  return database_.read<std::vector<std::string>>([&](PostgresConnection& connection)
                                                      -> Answer<std::vector<std::string>> {
    const PostgresRows rows = connection.query(
        // The owners are found one after another in the index, so the time depends on what is kept of each.
        "WITH RECURSIVE owners(owner) AS ((SELECT owner FROM jobs WHERE ended IS NOT NULL ORDER BY owner LIMIT 1) "
        "UNION "
        "ALL SELECT (SELECT owner FROM jobs WHERE ended IS NOT NULL AND owner > owners.owner ORDER BY owner LIMIT 1) "
        "FROM owners WHERE owners.owner IS NOT NULL) SELECT old.name FROM owners CROSS JOIN LATERAL (SELECT name, "
        "ended "
        "FROM jobs WHERE owner = owners.owner AND ended IS NOT NULL ORDER BY ended DESC, key DESC OFFSET $2) AS old "
        "WHERE old.ended < $1",
        PostgresValues()
            .add(std::chrono::duration_cast<std::chrono::nanoseconds>(before.time_since_epoch()).count())
            .add(static_cast<std::int64_t>(keep)));
    std::vector<std::string> names;
    for (int i = 0; i < rows.count(); ++i) names.push_back(rows.text(i, 0));
    return names;
  });
}

Answer<std::vector<Reference>> PostgresJobStore::references() {
  return database_.read<std::vector<Reference>>([](PostgresConnection& connection) -> Answer<std::vector<Reference>> {
    const PostgresRows rows = connection.query(postgres::select_rows());
    std::vector<Reference> all;
    for (int i = 0; i < rows.count(); ++i)
      if (const auto row = postgres::read_row(rows, i))
        for (std::string& digest : digests_of(row->record)) all.push_back({std::move(digest), row->record.job.owner()});
    return all;
  });
}

Answer<std::set<std::string>> PostgresJobStore::referenced(const std::set<std::string>& digests) {
  std::set<std::string> found;
  for (auto next = digests.begin(); next != digests.end();) {
    std::string list;
    for (int i = 0; i < kMostDigests && next != digests.end(); ++i, ++next)
      if (is_sha256(*next)) list += *next + ',';
    const auto asked = database_.read<bool>([&](PostgresConnection& connection) -> Answer<bool> {
      const PostgresRows rows = connection.query(
          "SELECT digest FROM unnest(string_to_array($1::text, ',')) AS asked(digest) "
          "WHERE EXISTS(SELECT 1 FROM needs WHERE needs.digest = asked.digest)",
          PostgresValues().add(list));
      for (int i = 0; i < rows.count(); ++i) found.insert(rows.text(i, 0));
      return true;
    });
    if (!asked) return tl::unexpected(asked.error());
  }
  return found;
}

Answer<std::set<std::string>> PostgresJobStore::needed_digests() {
  return database_.read<std::set<std::string>>([](PostgresConnection& connection) -> Answer<std::set<std::string>> {
    const PostgresRows rows = connection.query(postgres::select_rows("WHERE ended IS NULL"));
    std::set<std::string> needed;
    for (int i = 0; i < rows.count(); ++i)
      if (const auto row = postgres::read_row(rows, i)) add_needed(row->record, &needed);
    return needed;
  });
}

}  // namespace varimesh::server
