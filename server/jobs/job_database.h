// The database under a job store: its interface.
#pragma once

#include <functional>
#include <optional>
#include <type_traits>
#include <vector>

#include "server/jobs/job_record.h"
#include "server/jobs/sql.h"

namespace varimesh::server {

/// An open transaction, and the rules of a job's life at its time.
struct JobWork {
  Sql& sql;
  JobTransitions transitions;
  std::vector<News> news = {};  ///< What other processes are told once the transaction is committed.
};

/// Runs transactions on the tables of jobs. Thread-safe. Failures are those of every call of JobStore.
class JobDatabase {
 public:
  /// What happens if the connection is lost while a transaction is committed, so that only the database knows the
  /// outcome: wait until it can be asked, or give up in time because the caller can repeat the call. A call that can be
  /// skipped waits for nothing.
  enum class Outcome { MustBeKnown, CanBeAskedAgain, CanBeSkipped };

  virtual ~JobDatabase() = default;
  /// Whether the jobs outlive the process.
  virtual bool durable() const = 0;
  /// Whether other processes use the database at the same time.
  virtual bool shared() const { return false; }
  /// Runs `work`, which changes nothing, outside a transaction.
  virtual std::optional<Failure> read(const std::function<void(Sql&)>& work) = 0;
  /// Runs `work` in a transaction. It is committed, and on the disk when this returns, if `work` returns true, and has
  /// no effect otherwise. `work` may be run more than once.
  virtual std::optional<Failure> write(const std::function<bool(JobWork&)>& work, Outcome outcome) = 0;
  /// Gives up some of the room that is kept on the disk for changes that end or delete jobs. Returns false if there is
  /// none.
  virtual bool spend_room() { return false; }
  /// Whether the database could not be reached when it was last tried.
  virtual bool is_away() { return false; }
  /// As JobStore::stop_waiting() and JobStore::listen().
  virtual void stop_waiting() {}
  virtual void listen(std::function<void(const News&)>) {}
};

/// Returns the answer of `work`, which only reads, or why the database cannot be used.
template <class Work>
std::invoke_result_t<Work, Sql&> read_jobs(JobDatabase& database, const Work& work) {
  std::invoke_result_t<Work, Sql&> result;
  const auto failed = database.read([&](Sql& sql) { result = work(sql); });
  if (failed) return tl::unexpected(*failed);
  return result;
}

inline constexpr char kCountWaiting[] = "SELECT count(*) FROM jobs WHERE state = 1";
inline constexpr char kCountRunning[] = "SELECT count(*) FROM jobs WHERE worker <> ''";

}  // namespace varimesh::server
