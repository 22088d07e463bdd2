// A job store in an SQLite database. The jobs outlive the server.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/job_record.h"
#include "server/jobs/sqlite.h"
#include "server/jobs/turns.h"

namespace varimesh::server {

/// A job store with one writing connection, whose transactions are on the disk when a call returns (WAL,
/// synchronous=FULL), and one reading connection, which does not wait for the writer. One process at a time may use the
/// file; state/state_directory.h ensures that.
class SqliteJobStore : public JobStore {
 public:
  /// Creates the file if it does not exist. INTERNAL if it cannot be opened or was written by a newer version.
  static Answer<std::unique_ptr<SqliteJobStore>> open(const std::string& path, const JobStoreSettings& settings = {});

  bool durable() const override { return true; }
  Answer<Changed> submit(const Submission& submission) override;
  Answer<v1::Job> get(const std::string& name) override;
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) override;
  Answer<JobCounts> counts() override;
  Answer<std::optional<TimePoint>> oldest_pending() override;
  Answer<std::vector<v1::JobEvent>> events(const std::string& name) override;
  Answer<std::optional<Claimed>> claim(const std::string& worker) override;
  Answer<bool> renew_lease(const Claim& claim) override;
  Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) override;
  Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) override;
  Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) override;
  Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) override;
  Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) override;
  Answer<std::string> history_digest(const std::string& name) override;
  Answer<Changed> remove(const std::string& name) override;
  Answer<std::vector<std::string>> ended_beyond(std::size_t keep, TimePoint before) override;
  Answer<std::vector<Reference>> references() override;
  Answer<std::set<std::string>> needed_digests() override;

 private:
  SqliteJobStore(const std::string& path, const JobStoreSettings& settings);
  /// The peers with jobs that may be claimed, and how many jobs of each run.
  std::map<std::string, int> waiting_peers(SqliteDatabase& database) const;

  /// A change that waits to be written, on the stack of its caller.
  struct Write {
    std::function<bool(SqliteDatabase&)> work;  ///< Returns false if it refuses; then nothing is written.
    std::optional<Failure> failed;
    bool done = false;
  };
  /// Writes the change. One of the callers writes all waiting changes in one transaction; the others wait for it.
  void write(Write& change);
  void write_all(const std::vector<Write*>& changes);

  /// Runs `work` in a transaction, which is on the disk when this returns, or has no effect.
  template <class Result>
  Answer<Result> write(const std::function<Answer<Result>(SqliteDatabase&)>& work);
  template <class Result>
  Answer<Result> read(const std::function<Answer<Result>(SqliteDatabase&)>& work);
  /// Changes the job of a claim if the claim is still valid.
  template <class Result>
  Answer<Result> write(const Claim& claim, const std::function<Result(JobRecord&)>& work);

  const JobTransitions transitions_;
  std::mutex queue_mutex_;
  std::condition_variable written_;
  std::vector<Write*> queue_;
  bool writing_ = false;   ///< One of the callers is writing.
  SqliteDatabase writer_;  ///< Used only by that caller.
  Turns turns_;            ///< Used only by that caller.
  std::mutex reader_mutex_;
  SqliteDatabase reader_;
};

}  // namespace varimesh::server
