// Transactions of the database, repeated when the connection is lost or they meet each other.
#include "server/postgres/postgres_jobs.h"

#include <algorithm>
#include <atomic>
#include <set>
#include <thread>

#include "server/jobs/job_database.h"
#include "server/postgres/listener.h"
#include "server/postgres/pool.h"
#include "server/postgres/schema.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using Kind = PostgresError::Kind;

Failure failure_of(const PostgresError& error) {
  switch (error.kind()) {
    case Kind::Lost:
    case Kind::Retry:
      return store_unavailable().value();
    case Kind::Full:
      return store_full("The database's disk has no room for the job").value();
    case Kind::Other:
      break;
  }
  return internal_failure("The job store failed; the log of the server says why.").value();
}

std::string text_of(const News& news) {
  if (news.kind == News::Kind::Cancel) return kCancelNews + news.job;
  return news.kind == News::Kind::Changed ? kChangedNews + news.job : kQueueNews;
}

/// Tells other processes what a transaction has changed. They are hints, so the database does not wait for its disk. A
/// transaction that did this itself would keep a lock until its commit has reached the disk, so that no two such
/// commits would share a write.
void tell(const std::vector<News>& news, PostgresConnection& connection) {
  std::set<std::string> texts;
  for (const News& one : news) texts.insert(text_of(one));
  if (texts.empty()) return;
  std::string lines;
  for (const std::string& text : texts) lines += (lines.empty() ? "" : "\n") + text;
  try {
    connection.query(
        "WITH quick AS (SELECT set_config('synchronous_commit', 'off', true)) "
        "SELECT pg_notify('varimesh', one) FROM quick, unnest(string_to_array($1::text, E'\\n')) AS one",
        SqlValues().add(lines));
  } catch (const PostgresError&) {
    // The others look at the database by themselves, only later.
  }
}

class PostgresJobs : public JobDatabase {
 public:
  PostgresJobs(const PostgresSettings& where, const JobStoreSettings& settings)
      : settings_(settings), where_(where), pool_(where.url, where.connections, where.log) {}

  /// Checks the version of the tables, and that the jobs have their meshes in our directory.
  Answer<void> check();

  bool durable() const override { return true; }
  bool shared() const override { return true; }
  bool is_away() override { return pool_.lost_since().has_value(); }
  void stop_waiting() override { stops_ = true; }
  void listen(std::function<void(const News&)> listener) override {
    listener_.reset();
    if (listener) listener_ = std::make_unique<PostgresListener>(where_.url, std::move(listener));
  }
  std::optional<Failure> read(const std::function<void(Sql&)>& work) override {
    return with_connection(work, where_.patience);
  }
  std::optional<Failure> write(const std::function<bool(JobWork&)>& work, Outcome outcome) override;

 private:
  std::optional<Failure> with_connection(const std::function<void(PostgresConnection&)>& work,
                                         std::chrono::milliseconds patience);
  /// Returns whether the transaction was committed; nothing if that cannot be found out in time.
  std::optional<bool> was_committed(std::int64_t number, Outcome outcome);

  const JobStoreSettings settings_;
  const PostgresSettings where_;
  PostgresPool pool_;
  std::atomic<bool> stops_ = false;
  std::unique_ptr<PostgresListener> listener_;
};

Answer<void> PostgresJobs::check() {
  int version = 0;
  std::string meshes = settings_.meshes;
  const auto failed = with_connection(
      [&](PostgresConnection& connection) {
        version = postgres_version(connection);
        if (version != kPostgresVersion || settings_.meshes.empty()) return;
        connection.query("INSERT INTO meshes(directory) VALUES($1::text) ON CONFLICT DO NOTHING",
                         SqlValues().add(settings_.meshes));
        meshes = connection.query("SELECT directory FROM meshes").text(0, 0);
      },
      where_.patience);
  if (failed) return tl::unexpected(*failed);
  if (version > kPostgresVersion) return postgres_too_new(version);
  if (version < kPostgresVersion)
    return internal_failure((version == 0 ? "The database has no tables"
                                          : "The tables of the database have version " + std::to_string(version) +
                                                ", and this server needs version " + std::to_string(kPostgresVersion)) +
                            "; run varimeshd migrate with the same --store first.");
  if (meshes == settings_.meshes) return {};
  return internal_failure(
      "The jobs of this database have their meshes in another directory; start the server with that directory "
      "(--meshes, or --state if no --meshes was given), or choose another database. After the meshes were restored to "
      "a new place, the file 'name' must be there too.");
}

std::optional<Failure> PostgresJobs::with_connection(const std::function<void(PostgresConnection&)>& work,
                                                     std::chrono::milliseconds patience) {
  const SteadyTime start = std::chrono::steady_clock::now();
  // When the database is known to be away, the call fails at its first try.
  const SteadyTime end = pool_.lost_since().value_or(start) + patience;
  for (std::chrono::milliseconds pause{20};; pause = std::min(pause * 2, std::chrono::milliseconds(500))) {
    try {
      auto lent = pool_.take(start + patience);
      work(*lent);
      if (!(*lent).broken()) pool_.note_reached();
      return std::nullopt;
    } catch (const PostgresError& error) {
      const bool again = error.kind() == Kind::Lost || error.kind() == Kind::Retry;
      if (!again || std::chrono::steady_clock::now() + pause >= end) {
        if (error.kind() == Kind::Other) where_.log(std::string("the job store failed: ") + error.what());
        return failure_of(error);
      }
    }
    std::this_thread::sleep_for(pause);
  }
}

std::optional<Failure> PostgresJobs::write(const std::function<bool(JobWork&)>& work, Outcome outcome) {
  const auto patience = outcome == Outcome::CanBeSkipped ? std::chrono::milliseconds(0) : where_.patience;
  while (true) {
    std::optional<std::int64_t> unknown;
    const auto failed = with_connection(
        [&](PostgresConnection& connection) {
          PostgresTransaction open(connection);
          JobStoreSettings settings = settings_;
          if (!settings.clock) settings.clock = [now = open.time()] { return now; };
          JobWork transaction{connection, JobTransitions(settings)};
          if (!work(transaction)) return;
          try {
            open.commit();
          } catch (const PostgresError& error) {
            if (error.kind() != Kind::Lost) throw;
            unknown = open.number();
            return;
          }
          tell(transaction.news, connection);
        },
        patience);
    if (failed) return failed;
    if (!unknown) return std::nullopt;
    const auto committed = was_committed(*unknown, outcome);
    if (!committed) return store_unavailable().value();
    if (*committed) return std::nullopt;
  }
}

std::optional<bool> PostgresJobs::was_committed(std::int64_t number, Outcome outcome) {
  while (true) {
    std::optional<bool> committed;
    const auto failed = with_connection(
        [&](PostgresConnection& connection) {
          const PostgresRows rows =
              connection.query("SELECT pg_xact_status($1::bigint::text::xid8)", SqlValues().add(number));
          if (rows.view(0, 0) != "in progress") committed = rows.view(0, 0) == "committed";
        },
        where_.patience);
    if (committed) return committed;
    if (outcome == Outcome::CanBeSkipped || (failed && (outcome == Outcome::CanBeAskedAgain || stops_)))
      return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

}  // namespace

Answer<std::unique_ptr<JobStore>> open_postgres_jobs(const PostgresSettings& where, const JobStoreSettings& settings) {
  auto jobs = std::make_unique<PostgresJobs>(where, settings);
  if (const auto checked = jobs->check(); !checked) return tl::unexpected(checked.error());
  return std::make_unique<JobStore>(std::move(jobs), settings);
}

}  // namespace varimesh::server
