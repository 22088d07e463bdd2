// Jobs in a SQLite database beside the server: they outlive it.
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

namespace varimesh::server {

/// One writer, whose transactions are on the disk when a call returns (WAL, synchronous=FULL), and one reader, which
/// waits for no writer. The file belongs to one process at a time; see operations/state_directory.h.
class SqliteJobStore : public JobStore {
 public:
  /// Makes the file where it is not there. INTERNAL where it cannot be opened or was written by a newer version.
  static Answer<std::unique_ptr<SqliteJobStore>> open(const std::string& path, const JobStoreSettings& settings = {});

  bool durable() const override { return true; }
  Answer<Changed> submit(const Submission& submission) override;
  Answer<v1::Job> get(const std::string& name) override;
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) override;
  Answer<JobCounts> counts() override;
  Answer<std::vector<v1::JobEvent>> events(const std::string& name) override;
  Answer<std::optional<Claimed>> claim(const std::string& worker) override;
  Answer<bool> heartbeat(const Claim& claim) override;
  Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) override;
  Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) override;
  Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) override;
  Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) override;
  Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) override;
  Answer<std::string> history_digest(const std::string& name) override;
  Answer<Changed> remove(const std::string& name) override;
  Answer<std::vector<std::string>> ended_beyond(std::size_t keep) override;
  Answer<std::vector<std::string>> digests() override;
  Answer<std::set<std::string>> needed_digests() override;

 private:
  struct Row {
    std::int64_t key = 0;
    JobRecord record;
  };
  SqliteJobStore(const std::string& path, const JobStoreSettings& settings);

  /// A change that waits to be written, on the stack of its caller.
  struct Write {
    std::function<bool(SqliteDatabase&)> work;  ///< False: it refuses, and leaves nothing.
    std::optional<Failure> failed;
    bool done = false;
  };
  void write(Write& change);
  void write_all(const std::vector<Write*>& changes);

  /// Runs `work` in a transaction, on the disk when this returns, or not at all.
  template <class Result>
  Answer<Result> write(const std::function<Answer<Result>(SqliteDatabase&)>& work);
  template <class Result>
  Answer<Result> read(const std::function<Answer<Result>(SqliteDatabase&)>& work);
  /// Changes the job of a claim that is still good.
  template <class Result>
  Answer<Result> write(const Claim& claim, const std::function<Result(JobRecord&)>& work);

  static Answer<Row> load(SqliteDatabase& database, const std::string& name);
  static Row row_of(const SqliteQuery& query);
  static void save(SqliteDatabase& database, const Row& row);
  static void keep(SqliteDatabase& database, std::int64_t key, const Changed& changed);

  const JobTransitions transitions_;
  std::mutex queue_mutex_;
  std::condition_variable written_;
  std::vector<Write*> queue_;
  bool writing_ = false;   ///< One of the callers writes, for itself and for those that come meanwhile.
  SqliteDatabase writer_;  ///< Used by that one alone.
  std::mutex reader_mutex_;
  SqliteDatabase reader_;
};

}  // namespace varimesh::server
