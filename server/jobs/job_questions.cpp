// The calls that only read.
#include <algorithm>
#include <limits>

#include "core/base/sha256.h"
#include "server/jobs/job_rows.h"
#include "server/jobs/job_store.h"
#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

/// How many digests are asked for at once.
constexpr int kMostDigests = 1000;
/// For how long a call that is due, and that nobody makes, keeps its job.
constexpr std::chrono::hours kDueForGood{24};

/// Calls `take` for each job of select_jobs() whose row is not damaged.
void each_job(Sql& sql, std::string_view rest, const std::function<void(const JobRecord&)>& take) {
  sql.ask(select_jobs(sql, rest), {}, [&](const SqlRow& from) {
    if (const auto row = read_job(sql, from)) take(row->record);
  });
}

/// The statement of list(), and its parameters.
std::pair<std::string, SqlValues> page_query(const Sql& sql, const JobFilter& filter, int page_size,
                                             std::int64_t below) {
  SqlValues values;
  values.add(below > 0 ? below : std::numeric_limits<std::int64_t>::max()).add(std::int64_t{page_size} + 1);
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
    where += " AND owner = $" + std::to_string(++parameter);
  }
  for (const auto& [name, value] : filter.labels) {
    values.add(name).add(value);
    where += " AND EXISTS(SELECT 1 FROM labels WHERE labels.key = jobs.key AND labels.name = $" +
             std::to_string(parameter + 1) + " AND value = $" + std::to_string(parameter + 2) + ")";
    parameter += 2;
  }
  // The page ends with the row that makes it too large, so that the database does not send more.
  return {select_jobs(
              sql,
              "JOIN (SELECT key, sum(bytes) OVER (ORDER BY key DESC) - bytes AS bytes_before FROM (SELECT jobs.key, "
              "length(job) + length(spec) AS bytes FROM jobs JOIN specs ON specs.key = jobs.key WHERE " +
                  where +
                  " ORDER BY jobs.key DESC LIMIT $2) AS page) AS sums ON sums.key = jobs.key WHERE bytes_before <= $3 "
                  "ORDER BY jobs.key DESC"),
          std::move(values)};
}

}  // namespace

Answer<v1::Job> JobStore::get(const std::string& name) {
  return read_jobs(*database_, [&](Sql& sql) -> Answer<v1::Job> {
    return load_job(sql, name).map([](JobRow&& row) { return std::move(row.record.job); });
  });
}

Answer<JobPage> JobStore::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  const auto below = parse_page_token(page_token);
  if (!below) return tl::unexpected(below.error());
  return read_jobs(*database_, [&](Sql& sql) -> Answer<JobPage> {
    const auto [statement, values] = page_query(sql, filter, page_size, *below);
    JobPage page;
    int count = 0;
    std::int64_t last = 0;
    std::size_t bytes = 0;
    const auto take = [&](const SqlRow& from) {
      if (!page.next_page_token.empty()) return;
      bytes += bytes_of_job(from);
      if (count == page_size || (bytes > filter.most_bytes && count > 0)) {
        page.next_page_token = std::to_string(last);
        return;
      }
      ++count;
      last = from.number(0);
      if (auto row = read_job(sql, from)) page.jobs.push_back(std::move(row->record.job));  // no damaged ones
    };
    sql.ask(statement, values, take, Sql::Statement::Once);
    return page;
  });
}

Answer<JobCounts> JobStore::counts() {
  return read_jobs(*database_, [](Sql& sql) -> Answer<JobCounts> {
    return JobCounts{static_cast<int>(sql.number(kCountWaiting)), static_cast<int>(sql.number(kCountRunning))};
  });
}

Answer<int> JobStore::waiting_calls() {
  return read_jobs(*database_, [](Sql& sql) -> Answer<int> {
    return static_cast<int>(sql.number("SELECT count(*) FROM jobs WHERE call_due IS NOT NULL"));
  });
}

Answer<std::optional<TimePoint>> JobStore::oldest_pending() {
  using Result = std::optional<TimePoint>;
  return read_jobs(*database_, [](Sql& sql) -> Answer<Result> {
    // Keys are in the order of submission.
    const std::string oldest = std::string("(SELECT min(key) FROM ") + sql.dialect().waiting + " WHERE state = 1)";
    Answer<Result> found = Result();
    sql.ask(select_jobs(sql, "WHERE jobs.key = " + oldest), {}, [&](const SqlRow& from) {
      found =
          read_job(sql, from).map([](const JobRow& row) { return Result(time_point(row.record.job.create_time())); });
    });
    return found;
  });
}

Answer<std::vector<v1::JobEvent>> JobStore::events(const std::string& name) {
  return read_jobs(*database_, [&](Sql& sql) -> Answer<std::vector<v1::JobEvent>> {
    const auto row = load_job(sql, name);
    if (!row) return tl::unexpected(row.error());
    return load_events(sql, *row);
  });
}

Answer<std::string> JobStore::history_digest(const std::string& name) {
  return read_jobs(*database_, [&](Sql& sql) -> Answer<std::string> {
    return load_job(sql, name).map([](const JobRow& row) { return row.record.history_digest; });
  });
}

// ===== what jobs refer to =====

Answer<std::vector<std::string>> JobStore::ended_beyond(std::size_t keep, TimePoint before) {
  return read_jobs(*database_, [&](Sql& sql) -> Answer<std::vector<std::string>> {
    std::vector<std::string> names;
    // The owners are found one after another in the index, so the time depends on what is kept of each.
    const auto last = [](const std::string& column, const std::string& offset, const std::string& name) {
      return "(SELECT " + column +
             " FROM jobs WHERE owner = owners.owner AND ended IS NOT NULL "
             "ORDER BY ended DESC, key DESC LIMIT 1 OFFSET " +
             offset + ") AS " + name;
    };
    SqlValues values;
    values.add(nanoseconds(before)).add(static_cast<std::int64_t>(keep));
    add_time(values);
    values.add(std::int64_t{std::chrono::nanoseconds(kDueForGood).count()});
    values.add(2 * static_cast<std::int64_t>(keep));  // a job whose call waits stays longer, up to as many again
    sql.ask(
        "WITH RECURSIVE owners(owner) AS (SELECT (SELECT owner FROM jobs WHERE ended IS NOT NULL ORDER BY owner LIMIT "
        "1) UNION ALL SELECT (SELECT owner FROM jobs WHERE ended IS NOT NULL AND owner > owners.owner ORDER BY owner "
        "LIMIT 1) FROM owners WHERE owners.owner IS NOT NULL), "
        "firsts AS MATERIALIZED (SELECT owner, " +
            last("ended", "$2", "ended") + ", " + last("key", "$2", "key") + ", " + last("ended", "$5", "most_ended") +
            ", " + last("key", "$5", "most_key") +
            " FROM owners WHERE owner IS NOT NULL) "
            "SELECT name FROM firsts JOIN jobs ON jobs.owner = firsts.owner AND jobs.ended IS NOT NULL "
            "AND jobs.ended < $1 AND (jobs.ended, jobs.key) <= (firsts.ended, firsts.key) "
            "AND (jobs.call_due IS NULL OR jobs.call_due < coalesce($3, " +
            sql.dialect().now +
            ") - $4 OR (jobs.ended, jobs.key) <= (firsts.most_ended, firsts.most_key)) ORDER BY firsts.owner, "
            "jobs.ended DESC, jobs.key DESC",
        values, [&](const SqlRow& row) { names.push_back(row.text(0)); });
    return names;
  });
}

Answer<std::vector<Reference>> JobStore::references() {
  return read_jobs(*database_, [](Sql& sql) -> Answer<std::vector<Reference>> {
    std::vector<Reference> all;
    each_job(sql, {}, [&](const JobRecord& record) {
      for (std::string& digest : digests_of(record)) all.push_back({std::move(digest), record.job.owner()});
    });
    return all;
  });
}

Answer<std::set<std::string>> JobStore::referenced(const std::set<std::string>& digests) {
  std::set<std::string> found;
  if (!shared()) {
    const auto all = references();
    if (!all) return tl::unexpected(all.error());
    for (const Reference& reference : *all)
      if (digests.contains(reference.digest)) found.insert(reference.digest);
    return found;
  }
  for (auto next = digests.begin(); next != digests.end();) {
    std::string list;
    for (int i = 0; i < kMostDigests && next != digests.end(); ++i, ++next)
      if (is_sha256(*next)) list += *next + ',';
    const auto asked = read_jobs(*database_, [&](Sql& sql) -> Answer<void> {
      sql.ask(sql.dialect().referenced, SqlValues().add(list), [&](const SqlRow& row) { found.insert(row.text(0)); });
      return {};
    });
    if (!asked) return tl::unexpected(asked.error());
  }
  return found;
}

Answer<std::set<std::string>> JobStore::needed_digests() {
  return read_jobs(*database_, [](Sql& sql) -> Answer<std::set<std::string>> {
    std::set<std::string> needed;
    each_job(sql, "WHERE ended IS NULL", [&](const JobRecord& record) { add_needed(record, &needed); });
    return needed;
  });
}

}  // namespace varimesh::server
