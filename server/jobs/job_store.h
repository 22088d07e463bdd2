// The store of jobs: its interface. tests/server/jobs/job_store_conformance.h tests what every store must do.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "server/failure.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

using TimePoint = std::chrono::system_clock::time_point;
using SteadyTime = std::chrono::steady_clock::time_point;

/// The settings of every store.
struct JobStoreSettings {
  /// The clock of the leases. A store in a database uses the database's clock if this is empty.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  std::chrono::milliseconds lease{30'000};  ///< A worker that does not renew its lease for this long loses its job.
  int max_attempts = 3;                     ///< A job that is lost this often without progress becomes FAILED.
  /// So often may a job be lost without progress if its workers are not known to have crashed because of it; see
  /// kIsolating.
  int max_innocent_losses = 10;
  int max_running_of_peer = 0;  ///< How many jobs of one peer can be claimed at a time. 0: no limit.
  /// The name of the directory that has the meshes of the jobs. A store that outlives its server, elsewhere than in the
  /// server's directory, refuses a server with another one. Empty: this is not checked.
  std::string meshes = {};
};

/// Stands at the end of the name of a worker that runs each job in a process of its own. Such a worker tells when a job
/// has ended its process. So if the worker itself is lost, somebody has killed it, or its machine, and its jobs are
/// hardly to blame.
inline constexpr std::string_view kIsolating = " (processes)";

/// One step of priority counts as much as this waiting time, so that no job waits for ever.
inline constexpr std::chrono::minutes kPriorityStep{10};

/// A saved state of the solver, in the mesh store.
struct CheckpointReference {
  std::string digest;
  int iteration = 0;
};

/// The right of a worker to run a job. Every write includes the token, so a worker that has lost the job cannot change
/// it.
struct Claim {
  std::string name;
  std::int64_t token = 0;
  int attempt = 0;
  v1::JobSpec spec;
  std::optional<CheckpointReference> checkpoint;  ///< The state that an earlier attempt has saved.
  std::string owner = {};                         ///< The owner of the job.
  std::string trace = {};                         ///< The place of the job in a trace, as a header "traceparent".
  TimePoint submitted = {};                       ///< When the job was.
};

/// A job after a change. The store has saved the job and the events of the change together.
struct Changed {
  v1::Job job;
  std::vector<v1::JobEvent> events;   ///< With their numbers. Empty: nothing has changed.
  std::vector<std::string> released;  ///< Digests that the job no longer refers to.
};

/// A new claim, and the events of the change.
struct Claimed {
  Claim claim;
  std::vector<v1::JobEvent> events;
};

struct Submission {
  std::string request_id;
  v1::JobSpec spec;
  std::string name;
  int max_pending = 0;  ///< RESOURCE_EXHAUSTED (QUEUE_FULL) if this many jobs already wait; see is_full().
  std::string peer;     ///< Who the limits per peer count. Empty: unknown; then no limit on running jobs applies.
  int max_pending_of_peer = 0;  ///< PEER_LIMIT if this many jobs of the peer already wait. 0: no limit.
  std::string owner = {};       ///< Whose job it is. Each owner has request ids of its own. Empty: nobody's.
  std::string trace = {};       ///< The place of the job in a trace, as a header "traceparent".
};

/// A job that refers to something in the mesh store.
struct Reference {
  std::string digest;
  std::string owner;  ///< Of the job.
  bool operator==(const Reference&) const = default;
};

/// The size of a page of jobs, in bytes, unless its first job is larger. A client takes messages of at most 4 MiB.
inline constexpr std::size_t kMostPageBytes = std::size_t{1} << 20;

/// Which jobs to list: those of the owner (nothing: of all) in one of the states (empty: any) that have all of the
/// labels.
struct JobFilter {
  std::set<v1::JobState> states;
  std::map<std::string, std::string> labels;
  std::size_t most_bytes = kMostPageBytes;  ///< Of all jobs on a page.
  std::optional<std::string> owner = {};
};

struct JobPage {
  std::vector<v1::Job> jobs;
  std::string next_page_token;
};

struct JobCounts {
  int pending = 0;
  int running = 0;  ///< Including CANCELLING jobs.
};

/// What another process has done in a store that is shared.
struct News {
  enum class Kind {
    Reconnected,  ///< News may have been lost.
    Queue,        ///< A job waits.
    Cancel,       ///< A job is to be cancelled.
    Changed       ///< A job has new events.
  };
  Kind kind = Kind::Queue;
  std::string job = {};  ///< Of Cancel and Changed.
};

/// How an attempt ended.
struct Ending {
  v1::JobState state = v1::JOB_STATE_FAILED;  ///< PENDING: the job has not ended, and another attempt will continue it.
  std::optional<v1::JobError> error;
  std::optional<v1::Metrics> metrics;  ///< Its quality reports become events.
  std::vector<v1::StoredMesh> results;
  std::string history_digest;  ///< Of a serialised v1::History. Empty: none.
  /// Why the attempt was lost with the process that ran it, as a part of a sentence; the state is then PENDING. After
  /// the last attempt the job is FAILED. Empty: the attempt was not lost.
  std::string lost = {};
};

/// Stores jobs, their states and their events. Thread-safe; all calls may wait for a disk. If the store is durable(),
/// it keeps what a call has answered, whatever happens to the process afterwards.
///
/// Every call can fail with RESOURCE_EXHAUSTED (STORE_FULL: the disk is full), INTERNAL, or UNAVAILABLE
/// (STORE_UNAVAILABLE: a database cannot be reached); then nothing has changed.
/// Calls with a claim fail with ABORTED (CLAIM_LOST) if another worker has taken the job over. Calls with a name fail
/// with NOT_FOUND if there is no such job.
///
/// The store numbers the events of state and quality. Their numbers follow the last number that the store knows and
/// `last_sequence`, the last number that the caller has given to an iteration. A job that was lost continues in the
/// next range of numbers, since nobody knows which numbers of the last range clients have seen.
class JobStore {
 public:
  virtual ~JobStore() = default;
  /// Whether the jobs outlive the process.
  virtual bool durable() const = 0;
  /// Whether other processes use the store at the same time.
  virtual bool shared() const { return false; }
  /// The process is about to end: no call waits any longer for the outcome of a change that cannot be asked for.
  virtual void stop_waiting() {}
  /// Calls `listener` when another process has changed something, from a thread of the store. Empty: no more; when this
  /// returns, no call is under way. The news are hints: they may be late, or lost, and some are needless.
  virtual void listen(std::function<void(const News&)>) {}

  /// Stores a new job, or returns the job of the same owner and request, without events. ALREADY_EXISTS if that has
  /// another spec.
  virtual Answer<Changed> submit(const Submission& submission) = 0;
  virtual Answer<v1::Job> get(const std::string& name) = 0;
  /// Lists jobs, newest first. `page_token` is empty or comes from the previous page. A page ends after `page_size`
  /// jobs, or before the job that would make it larger than `filter.most_bytes`; it has at least one job.
  virtual Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) = 0;
  virtual Answer<JobCounts> counts() = 0;
  /// Returns when the job was submitted that has waited longest; nothing if none waits, or if the store does not know.
  virtual Answer<std::optional<TimePoint>> oldest_pending() { return std::nullopt; }
  /// Returns all events of state and quality, in order.
  virtual Answer<std::vector<v1::JobEvent>> events(const std::string& name) = 0;

  /// Claims the next job, which becomes RUNNING, with a lease. Returns nothing if no job waits, except jobs of peers
  /// that already have as many running as they may have. Peers take turns (turns.h), and the jobs of each peer come in
  /// the order of turn_of().
  virtual Answer<std::optional<Claimed>> claim(const std::string& worker) = 0;
  /// Renews the lease. Returns true if the job is to be cancelled.
  virtual Answer<bool> renew_lease(const Claim& claim) = 0;
  /// Records the newest iteration for watchers that connect later. Called at most twice per second and job.
  virtual Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration,
                                     std::int64_t last_sequence) = 0;
  /// Records a checkpoint, from which the next attempt will continue, and releases the previous one.
  virtual Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) = 0;
  /// Records the end of the attempt. Unless the state is PENDING, it is the end of the job.
  virtual Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) = 0;

  /// PENDING becomes CANCELLED, RUNNING becomes CANCELLING, every other state stays.
  virtual Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) = 0;
  /// As request_cancel(), for a caller that does not know the last event number of a running job. Such a job becomes
  /// CANCELLING without an event; see_cancel() adds it.
  virtual Answer<Changed> ask_to_cancel(const std::string& name) { return request_cancel(name, 0); }
  /// Adds the event of a cancel request that renew_lease() has told of, if it has none.
  virtual Answer<Changed> see_cancel(const Claim&, std::int64_t) { return Changed{}; }
  /// Takes jobs back from workers whose lease has expired, and all jobs from `worker`, which has just started and runs
  /// none. They become PENDING, or CANCELLED if that was requested, or FAILED after the last attempt. The jobs in
  /// `running` are not taken back: the caller runs them but could not renew their leases.
  virtual Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) = 0;

  /// Returns the digest of the history of a job that has a result.
  virtual Answer<std::string> history_digest(const std::string& name) = 0;
  /// Deletes a job and releases everything that it refers to. FAILED_PRECONDITION if it has not ended.
  virtual Answer<Changed> remove(const std::string& name) = 0;
  /// Returns the names of all jobs that ended before `before`, except those among the `keep` of their owner that ended
  /// last.
  virtual Answer<std::vector<std::string>> ended_beyond(std::size_t keep, TimePoint before) = 0;
  /// Returns everything that jobs refer to.
  virtual Answer<std::vector<Reference>> references() = 0;
  /// Returns those of the digests that jobs refer to. A database answers this without looking at all jobs.
  virtual Answer<std::set<std::string>> referenced(const std::set<std::string>& digests) {
    const auto all = references();
    if (!all) return tl::unexpected(all.error());
    std::set<std::string> found;
    for (const Reference& reference : *all)
      if (digests.contains(reference.digest)) found.insert(reference.digest);
    return found;
  }
  /// Returns the digests of the meshes and checkpoints of all jobs that have not ended.
  virtual Answer<std::set<std::string>> needed_digests() = 0;
};

/// Returns whether a job in this state will never change again.
inline bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

}  // namespace varimesh::server
