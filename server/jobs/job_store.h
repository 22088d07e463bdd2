// Where jobs are kept: the interface, whatever database is behind it.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/failure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

using TimePoint = std::chrono::system_clock::time_point;

/// A worker's right to run a job. The token goes into every write, so that a worker that was given up cannot disturb.
struct Claim {
  std::string name;
  std::int64_t token = 0;
  int attempt = 0;
  v1::JobSpec spec;
};

/// A job that was submitted, now or before.
struct Submitted {
  v1::Job job;
  bool created = false;  ///< False: the same request was there already.
};

struct JobFilter {
  std::vector<v1::JobState> states;
  std::map<std::string, std::string> labels;
};

struct JobPage {
  std::vector<v1::Job> jobs;
  std::string next_page_token;
};

struct JobCounts {
  int pending = 0;
  int running = 0;  ///< CANCELLING ones too.
};

/// How an attempt ended.
struct Ending {
  v1::JobState state = v1::JOB_STATE_FAILED;
  std::optional<v1::JobError> error;
  std::optional<v1::Metrics> metrics;
  std::vector<v1::StoredMesh> results;
  std::string history_digest;  ///< Of a serialised v1::History; empty: none.
};

/// Everything a forgotten job leaves to be released.
struct Removed {
  std::vector<std::string> digests;
};

/// Jobs and their states. All calls may come from any thread and may wait for a disk.
class JobStore {
 public:
  virtual ~JobStore() = default;

  /// Keeps a new job under `name`, or finds the one of the same request. ALREADY_EXISTS where that had another spec;
  /// RESOURCE_EXHAUSTED where `max_pending` wait already.
  virtual Answer<Submitted> submit(const std::string& request_id, const v1::JobSpec& spec, const std::string& name,
                                   TimePoint now, int max_pending) = 0;
  virtual Answer<v1::Job> get(const std::string& name) = 0;
  virtual Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) = 0;
  virtual JobCounts counts() = 0;

  /// The oldest job that waits, now RUNNING; none where none waits.
  virtual std::optional<Claim> claim(TimePoint now) = 0;
  /// PENDING becomes CANCELLED, RUNNING becomes CANCELLING, every other state stays.
  virtual Answer<v1::Job> request_cancel(const std::string& name, TimePoint now) = 0;
  /// What a watcher who comes late wants to see; called at most twice a second a job.
  virtual void note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) = 0;
  virtual Answer<v1::Job> finish(const Claim& claim, const Ending& ending, TimePoint now) = 0;

  /// Where the history of a job that SUCCEEDED lies.
  virtual Answer<std::string> history_digest(const std::string& name) = 0;
  /// FAILED_PRECONDITION where it has not ended.
  virtual Answer<Removed> remove(const std::string& name) = 0;
  /// Names of the jobs that ended longest ago, beyond the newest `keep`.
  virtual std::vector<std::string> ended_beyond(std::size_t keep) = 0;
};

/// Whether a job in that state will never change again.
inline bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

}  // namespace varimesh::server
