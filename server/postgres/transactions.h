// Transactions of the database, repeated when the connection is lost or they meet each other.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <set>
#include <string>

#include "server/jobs/job_record.h"
#include "server/postgres/pool.h"

namespace varimesh::server {

/// What a job store in PostgreSQL needs besides the settings of every store.
struct PostgresSettings {
  std::string url;
  int connections = 8;                        ///< At most, at a time.
  std::chrono::milliseconds patience{5'000};  ///< How long a call waits for a database that cannot be reached.
  std::function<void(const std::string& line)> log = [](const auto&) {};
};

/// An open transaction, and the rules of a job's life at its time.
struct PostgresWork {
  PostgresConnection& connection;
  JobTransitions transitions;
  /// What the other processes are told afterwards. A transaction that does so itself keeps a lock until its commit has
  /// reached the disk, so that no two such commits would share a write.
  std::set<std::string> news = {};
};

/// Runs transactions. Thread-safe. Failures: UNAVAILABLE (STORE_UNAVAILABLE), RESOURCE_EXHAUSTED (STORE_FULL) and
/// INTERNAL.
class PostgresTransactions {
 public:
  /// What happens if the connection is lost while the transaction is committed, so that only the database knows the
  /// outcome: wait until it can be asked, or give up in time because the caller can repeat the call. A call that can be
  /// skipped waits for nothing.
  enum class Outcome { MustBeKnown, CanBeAskedAgain, CanBeSkipped };

  PostgresTransactions(const PostgresSettings& where, const JobStoreSettings& settings)
      : settings_(settings), where_(where), pool_(where.url, where.connections, where.log) {}

  const JobStoreSettings& settings() const { return settings_; }
  const PostgresSettings& where() const { return where_; }
  /// From now on a call gives up if the database cannot tell the outcome of its transaction.
  void stop_waiting() { stops_ = true; }
  /// Whether the database could not be reached when it was last tried.
  bool is_away() { return pool_.lost_since().has_value(); }

  /// Runs `work` outside a transaction, for a single statement.
  template <class Result>
  Answer<Result> read(const std::function<Answer<Result>(PostgresConnection&)>& work) {
    Answer<Result> result;
    if (const auto failed = with_connection([&](PostgresConnection& connection) { result = work(connection); }))
      return tl::unexpected(*failed);
    return result;
  }

  /// Runs `work` in a transaction, which is committed if `work` has an answer, and has no effect otherwise. `work` may
  /// be run more than once.
  template <class Result>
  Answer<Result> write(const std::function<Answer<Result>(PostgresWork&)>& work,
                       Outcome outcome = Outcome::MustBeKnown) {
    Answer<Result> result;
    const auto failed = with_transaction(
        [&](PostgresWork& transaction) {
          result = work(transaction);
          return result.has_value();
        },
        outcome);
    if (failed) return tl::unexpected(*failed);
    return result;
  }

 private:
  std::optional<Failure> with_connection(const std::function<void(PostgresConnection&)>& work) {
    return with_connection(work, where_.patience);
  }
  std::optional<Failure> with_connection(const std::function<void(PostgresConnection&)>& work,
                                         std::chrono::milliseconds patience);
  std::optional<Failure> with_transaction(const std::function<bool(PostgresWork&)>& work, Outcome outcome);
  /// Returns whether the transaction was committed; nothing if that cannot be found out in time.
  std::optional<bool> was_committed(std::int64_t number, Outcome outcome);

  const JobStoreSettings settings_;
  const PostgresSettings where_;
  PostgresPool pool_;
  std::atomic<bool> stops_ = false;
};

}  // namespace varimesh::server
