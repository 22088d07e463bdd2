// Where jobs are kept: the interface, whatever database is behind it. tests/server/job_store_conformance.h says what
// every store must do.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/failure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

using TimePoint = std::chrono::system_clock::time_point;

/// What every store is told.
struct JobStoreSettings {
  std::function<TimePoint()> clock = std::chrono::system_clock::now;  ///< The only one that leases go by.
  std::chrono::milliseconds lease{30'000};  ///< A worker that is not heard of for so long has lost its job.
  int max_attempts = 3;                     ///< A job that was lost so often without coming further is FAILED.
  int max_running_of_owner = 0;             ///< No more are claimed of one owner's at a time; 0: no limit.
};

/// A job's place in the queue: a step of priority is worth so long a wait, so that nobody waits for ever.
inline constexpr std::chrono::minutes kPriorityStep{10};

/// The solver's state, in the mesh store.
struct CheckpointReference {
  std::string digest;
  int iteration = 0;
};

/// A worker's right to run a job. The token goes into every write, so that a worker that was given up cannot disturb.
struct Claim {
  std::string name;
  std::int64_t token = 0;
  int attempt = 0;
  v1::JobSpec spec;
  std::optional<CheckpointReference> checkpoint;  ///< Where an attempt before this one had come to.
};

/// A job as a change left it. The events of the change are in the store together with it.
struct Changed {
  v1::Job job;
  std::vector<v1::JobEvent> events;   ///< Numbered; none: nothing changed.
  std::vector<std::string> released;  ///< Digests that the job refers to no more.
};

struct Claimed {
  Claim claim;
  std::vector<v1::JobEvent> events;
};

struct Submission {
  std::string request_id;
  v1::JobSpec spec;
  std::string name;
  int max_pending = 0;           ///< RESOURCE_EXHAUSTED (QUEUE_FULL) where so many wait already.
  std::string owner;             ///< Whose job it is; empty: nobody knows, and no limit of running jobs holds.
  int max_pending_of_owner = 0;  ///< PEER_LIMIT where so many of the owner's wait already; 0: no limit.
};

struct JobFilter {
  std::set<v1::JobState> states;
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
  v1::JobState state =
      v1::JOB_STATE_FAILED;  ///< PENDING: not at all; the job is to be gone on with by another attempt.
  std::optional<v1::JobError> error;
  std::optional<v1::Metrics> metrics;  ///< Its reports become the events of quality.
  std::vector<v1::StoredMesh> results;
  std::string history_digest;  ///< Of a serialised v1::History; empty: none.
};

/// Jobs, their states and what happened to them. All calls may come from any thread and may wait for a disk. What a
/// call has answered is kept, whatever happens to the process afterwards, if the store is durable().
///
/// Any call can fail with RESOURCE_EXHAUSTED (STORE_FULL: the disk is full) or INTERNAL; then nothing was changed.
/// Calls with a claim fail with ABORTED (CLAIM_LOST) where the job is another worker's by now, calls with a name with
/// NOT_FOUND.
///
/// Events of state and quality are numbered here, behind the last number known here and behind `last_sequence`, the
/// last that the caller has given to an iteration. A job that was lost goes on in the next block of numbers, since
/// nobody knows which of the last block were seen.
class JobStore {
 public:
  virtual ~JobStore() = default;
  virtual bool durable() const = 0;

  /// Keeps a new job, or finds that of the same request, without events. ALREADY_EXISTS where that had another spec.
  virtual Answer<Changed> submit(const Submission& submission) = 0;
  virtual Answer<v1::Job> get(const std::string& name) = 0;
  /// Newest first.
  virtual Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) = 0;
  virtual Answer<JobCounts> counts() = 0;
  /// All events of state and quality, in order.
  virtual Answer<std::vector<v1::JobEvent>> events(const std::string& name) = 0;

  /// The job whose turn it is, now RUNNING, with a lease; none where none waits but of owners that have enough running.
  virtual Answer<std::optional<Claimed>> claim(const std::string& worker) = 0;
  /// Renews the lease. True: somebody asked for the job to be cancelled.
  virtual Answer<bool> heartbeat(const Claim& claim) = 0;
  /// What a watcher who comes late wants to see; called at most twice a second a job.
  virtual Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration,
                                     std::int64_t last_sequence) = 0;
  /// The next attempt begins here. The checkpoint before, where there is one, is released.
  virtual Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) = 0;
  /// The attempt's end, which is the job's unless its state is PENDING.
  virtual Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) = 0;

  /// PENDING becomes CANCELLED, RUNNING becomes CANCELLING, every other state stays.
  virtual Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) = 0;
  /// Takes jobs from workers whose lease has run out, and all from `worker`, which has none now: they wait again, or
  /// are CANCELLED where that was asked for, or FAILED after the last attempt. Jobs named in `running` stay: whoever
  /// asks runs them, and could only not renew their leases.
  virtual Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) = 0;

  /// Where the history of a job that has a result lies.
  virtual Answer<std::string> history_digest(const std::string& name) = 0;
  /// Forgets a job and releases all it refers to. FAILED_PRECONDITION where it has not ended.
  virtual Answer<Changed> remove(const std::string& name) = 0;
  /// Names of the jobs that ended longest ago, beyond the newest `keep`.
  virtual Answer<std::vector<std::string>> ended_beyond(std::size_t keep) = 0;
  /// What all jobs refer to in the mesh store, once for each reference.
  virtual Answer<std::vector<std::string>> digests() = 0;
  /// What the jobs that have not ended read: their meshes and checkpoints.
  virtual Answer<std::set<std::string>> needed_digests() = 0;
};

/// Whether a job in that state will never change again.
inline bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

}  // namespace varimesh::server
