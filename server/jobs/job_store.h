// The store of jobs. tests/server/jobs/job_store_conformance.h tests it with every database.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
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

/// The settings of a store.
struct JobStoreSettings {
  /// The clock of the leases. A store in a database uses the database's clock if this is empty.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  std::chrono::milliseconds lease{30'000};  ///< A worker that does not renew its lease for this long loses its job.
  int max_attempts = 3;                     ///< A job that is lost this often without progress becomes FAILED.
  /// A job may be lost this often without progress if its workers are not known to have crashed because of it; see
  /// kIsolating.
  int max_innocent_losses = 10;
  int max_running_of_peer = 0;  ///< How many jobs of one peer can be claimed at a time. 0: no limit.
  /// The name of the directory that has the meshes of the jobs. A store that outlives its server and lies outside the
  /// server's directory refuses a server with another directory. Empty: this is not checked.
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
  TimePoint submitted = {};                       ///< When the job was submitted.
  int lost = 0;  ///< Attempts since the last progress whose processes ended before their runs.
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
  bool needs_device = false;    ///< Only a server that lends devices takes the job, if the store is shared.
};

/// Which jobs a worker would take now.
struct ClaimFilter {
  bool only_first = false;       ///< Only jobs of peers without a running job.
  bool needs_no_device = false;  ///< Only jobs that any server can take.
};

/// Devices that servers lend to jobs.
struct LentDevices {
  int devices = 0;
  int busy = 0;            ///< Devices that a job has.
  int jobs = 0;            ///< Jobs that have a device.
  std::string names = {};  ///< Different cards with ", " between them.
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

/// What came of a call of a job's webhook.
struct CallOutcome {
  std::string error = {};  ///< Why the call failed, as a sentence; empty: it did not.
  /// When it is made again; nothing: never.
  std::optional<std::chrono::milliseconds> again_after = {};
  bool was_made = true;  ///< Otherwise it is only put off, and does not count.
};

class JobDatabase;
class Sql;
class SqlValues;

/// Stores jobs, their states and their events. Thread-safe; all calls may wait for a disk. If the store is durable(),
/// it keeps what a call has answered, whatever happens to the process afterwards.
///
/// Every call can fail with RESOURCE_EXHAUSTED (STORE_FULL: the disk is full), INTERNAL, or UNAVAILABLE
/// (STORE_UNAVAILABLE: a database cannot be reached); then nothing has changed.
/// Calls with a claim fail with ABORTED (CLAIM_LOST) if another worker has taken the job over. Calls with a name fail
/// with NOT_FOUND if there is no such job, and with DATA_LOSS if its record is damaged.
///
/// The store numbers the events of state and quality. Their numbers follow the last number that the store knows and
/// `last_sequence`, the last number that the caller has given to an iteration. A job that was lost continues in the
/// next range of numbers, since nobody knows which numbers of the last range clients have seen.
///
/// If the connection to a shared database breaks while a transaction is committed, the store asks the database for the
/// outcome; only submit(), request_cancel() and remove(), which a client can repeat, give up before it is known.
class JobStore {
 public:
  /// The clock of the settings may be empty if the database has one.
  JobStore(std::unique_ptr<JobDatabase> database, const JobStoreSettings& settings);
  ~JobStore();

  /// Whether the jobs outlive the process.
  bool durable() const;
  /// Whether other processes use the store at the same time.
  bool shared() const;
  /// The process is about to end: no call waits any longer for the outcome of a change that cannot be asked for.
  void stop_waiting();
  /// Calls `listener` when another process has changed something, from a thread of the store. An empty `listener` ends
  /// this; when the function returns, no call is under way. The news are hints: they may be late, or lost, and some are
  /// needless.
  void listen(std::function<void(const News&)> listener);

  /// Stores a new job, or returns the job of the same owner and request, without events. ALREADY_EXISTS if this job has
  /// another spec. The limit of waiting jobs may be exceeded by the jobs that several processes submit at the same
  /// moment.
  Answer<Changed> submit(const Submission& submission);
  Answer<v1::Job> get(const std::string& name);
  /// Lists jobs, newest first. `page_token` is empty or comes from the previous page. A page ends after `page_size`
  /// jobs, or before the job that would make it larger than `filter.most_bytes`; it has at least one job.
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token);
  Answer<JobCounts> counts();
  /// Returns when the job that has waited longest was submitted; nothing if no job waits.
  Answer<std::optional<TimePoint>> oldest_pending();
  /// Returns all events of state and quality, in order.
  Answer<std::vector<v1::JobEvent>> events(const std::string& name);

  /// Claims the next job, which becomes RUNNING, with a lease. Returns nothing if no job waits, except jobs of peers
  /// that already have as many running as they may have. Peers take turns, so that nobody waits for all jobs of
  /// somebody else: the next peer is the one with the fewest running jobs, and among equals the one whose last turn was
  /// longest ago. The jobs of each peer come in the order of turn_of().
  Answer<std::optional<Claimed>> claim(const std::string& worker, const ClaimFilter& filter = {});
  /// Renews the lease. Returns true if the job is to be cancelled.
  Answer<bool> renew_lease(const Claim& claim);
  /// Records the newest iteration for watchers that connect later. Called at most twice per second and job.
  Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence);
  /// Records a checkpoint, from which the next attempt will continue, and releases the previous one.
  Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint);
  /// Records the end of the attempt. Unless the state is PENDING, it is the end of the job.
  Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence);

  /// PENDING becomes CANCELLED, RUNNING becomes CANCELLING, every other state stays.
  Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence);
  /// As request_cancel(), for a caller that does not know the last event number of a running job. In a shared store a
  /// running job becomes CANCELLING without an event; see_cancel() adds it.
  Answer<Changed> ask_to_cancel(const std::string& name);
  /// Adds the event of a cancel request that renew_lease() has told of, if the job has no such event.
  Answer<Changed> see_cancel(const Claim& claim, std::int64_t last_sequence);
  /// Takes jobs back from workers whose lease has expired, and all jobs from `worker`, which has just started and runs
  /// none. They become PENDING, or CANCELLED if that was requested, or FAILED after the last attempt. The jobs in
  /// `running` are not taken back: the caller runs them but could not renew their leases.
  Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running);

  // Devices, in job_devices.cpp. Only the servers of a shared store have to tell each other of their devices; in other
  // stores these calls do nothing.
  /// Tells the other servers which devices `worker` lends. This counts for one lease time. A call that cannot reach the
  /// database is skipped.
  Answer<void> note_devices(const std::string& worker, const LentDevices& devices);
  /// Returns what all servers together lend, as each server last reported it.
  Answer<LentDevices> lent_devices();
  /// If no server lends devices, tells this to the jobs that wait for a device: each gets a log line as an event, once.
  Answer<std::vector<Changed>> tell_of_missing_devices();

  /// Claims the webhook that has been due longest, and returns its job, or nothing if no webhook is due. The webhook
  /// can be claimed again after `patience` unless note_call() is called before, since its caller may be lost.
  Answer<std::optional<v1::Job>> claim_call(std::chrono::milliseconds patience);
  /// Records what came of the call, unless another outcome has ended it. NOT_FOUND if the job was deleted meanwhile.
  Answer<void> note_call(const std::string& name, const CallOutcome& outcome);
  /// How many webhooks are to be called, now or later.
  Answer<int> waiting_calls();

  /// Returns the digest of the history of a job that has a result.
  Answer<std::string> history_digest(const std::string& name);
  /// Deletes a job and releases everything that it refers to. FAILED_PRECONDITION if it has not ended. A damaged job is
  /// deleted too, and releases nothing, since nobody knows what it refers to.
  Answer<Changed> remove(const std::string& name);
  /// Returns the names of all jobs that ended before `before`, except the last `keep` ended jobs of each owner, and
  /// jobs whose webhook is still to be called. A call that has been due for a day does not count: no server makes calls
  /// any more.
  Answer<std::vector<std::string>> ended_beyond(std::size_t keep, TimePoint before);
  /// Returns everything that jobs refer to.
  Answer<std::vector<Reference>> references();
  /// Returns the digests among these that jobs refer to. A shared database answers this without looking at all jobs.
  Answer<std::set<std::string>> referenced(const std::set<std::string>& digests);
  /// Returns the digests of the meshes and checkpoints of all jobs that have not ended.
  Answer<std::set<std::string>> needed_digests();

 private:
  /// QUEUE_FULL or PEER_LIMIT if another job may not wait.
  Answer<void> check_room(Sql& sql, const Submission& submission);
  /// Whether a count of the waiting jobs shows, without another one, that there is room for more.
  bool has_ample_room(int max_pending);
  /// Adds the time as `$N`, for coalesce($N, dialect().now): null if the database's clock counts.
  void add_time(SqlValues& values) const;

  const std::unique_ptr<JobDatabase> database_;
  const JobStoreSettings settings_;
  std::mutex waiting_mutex_;
  std::int64_t waiting_ = 0;  ///< Jobs that waited when they were counted, and those that this process added since.
  std::optional<SteadyTime> counted_;
};

/// Returns whether a job in this state will never change again.
inline bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

}  // namespace varimesh::server
