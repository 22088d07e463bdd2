// Accepts jobs, decides which job runs when, cancels jobs and deletes old ones.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/engine/engine.h"
#include "server/jobs/job_store.h"
#include "server/meshes/mesh_store.h"
#include "server/resources/device_budget.h"
#include "server/resources/memory_budget.h"
#include "server/resources/rate.h"
#include "server/resources/thread_shares.h"
#include "server/scheduling/job_logs.h"
#include "server/scheduling/owned_meshes.h"
#include "server/tracing/spans.h"

namespace varimesh::server {

/// The settings of the scheduler. Time, names and threads are passed in, so that tests can control them.
struct SchedulerSettings {
  int threads = 1;              ///< The thread budget. At most this many jobs run at a time.
  int max_pending = 1000;       ///< Jobs that may wait. More are refused with QUEUE_FULL.
  int max_pending_of_peer = 0;  ///< Jobs of one peer that may wait; PEER_LIMIT. 0: no limit.
  int max_submissions = 0;      ///< Jobs that one peer may submit in a minute; PEER_LIMIT. 0: no limit.
  int max_priority = 100;       ///< The highest priority of a job, except for admins.
  int max_ended = 1000;         ///< Ended jobs of an owner that are kept with their results; older ones are deleted,
  std::chrono::milliseconds min_ended_age{0};  ///< but only this long after their end, however many there are.
  std::chrono::milliseconds max_ended_age{0};  ///< Ended jobs are deleted after this time. 0: no limit.
  /// The name under which jobs are claimed. The only process that uses a store keeps its name after a restart.
  std::string worker = "local";
  std::chrono::milliseconds renewal_interval{10'000};  ///< Time between two renewals of the leases: a third of a lease.
  std::chrono::milliseconds checkpoint_pause{5'000};   ///< Shortest time between two checkpoints of a job.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;    ///< For the times that clients are told.
  std::function<SteadyTime()> steady = std::chrono::steady_clock::now;  ///< For intervals; nobody sets it back.
  std::function<bool()> has_room = [] {
    return true;
  };                                      ///< Whether the disk has room for another job; STORE_FULL if not.
  std::function<std::string()> new_name;  ///< Returns a new unique name, "jobs/…". Thread-safe.
  std::int64_t memory = 0;                ///< Memory of all running jobs together, in bytes. 0: no limit.
  std::vector<std::string> devices = {};  ///< Of the running jobs, as DeviceBudget has them.
  int jobs_per_device = 1;
  std::string device_names = {};  ///< What these devices are called.
  using Job = std::function<void(const LentThreads& threads)>;
  /// Runs a job, with at most `threads` threads, on another thread.
  std::function<void(int threads, Job job)> launch;
  std::function<void(const std::string& job, const std::string& what)> log = [](const auto&, const auto&) {};
  std::function<void(const v1::Job&)> noted = [](const auto&) {};  ///< Called with each job that is new or has ended.
  SpanSink spans = {};  ///< Takes the spans of the runs. Empty: nobody wants them.
  std::function<void(const KernelWork&)> kernels_worked = [](const auto&) {};  ///< Attempt::kernels_worked.
  /// Whether the server may call the webhook of a job; INVALID_ARGUMENT (BAD_OPTION) if not. Empty: no job has one.
  std::function<Answer<void>(const v1::Webhook&)> check_webhook = {};
  std::function<void()> lost = [] {};  ///< Called for each job that was taken back from a worker that was lost.
};

/// Who submits a job.
struct Submitter {
  std::string peer = {};   ///< Who the limits per peer count.
  std::string owner = {};  ///< Whose job it is.
  bool is_admin = false;   ///< The job may have any priority.
  std::string trace = {};  ///< The place of the job in a trace, as a header "traceparent".
};

/// Runs the jobs of a store. Thread-safe.
class Scheduler {
 public:
  Scheduler(JobStore* jobs, MeshStore* meshes, Engine engine, SchedulerSettings settings);
  /// Requires that no job runs: drain() has returned true.
  ~Scheduler();

  /// Takes back the jobs that were running when the previous process ended, and counts the references of all jobs. Call
  /// it first, before any other call. tick() then starts the jobs.
  Answer<void> recover();
  /// Called about once per second: renews leases, takes lost jobs back, and starts waiting jobs.
  void tick();

  /// Checks everything that can be checked without running the job, and queues it unless `validate_only` is true.
  Answer<v1::Job> submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only,
                         const Submitter& submitter = {});
  Answer<v1::Job> get(const std::string& name);
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token);
  Answer<v1::Job> cancel(const std::string& name);
  Answer<v1::Job> remove(const std::string& name);
  Answer<JobCounts> counts() { return jobs_->counts(); }
  Answer<std::optional<TimePoint>> oldest_pending() { return jobs_->oldest_pending(); }

  /// The devices of this server.
  const DeviceBudget& devices() const { return devices_; }
  /// The devices that jobs may have: those of this server or, if the store is shared, of all its servers.
  LentDevices lent_devices();
  /// Takes the spans of calls too.
  const SpanSink& spans() const { return settings_.spans; }

  Answer<std::shared_ptr<EventLog>> events(const std::string& name);
  /// Returns all iterations of a job that has SUCCEEDED.
  Answer<v1::History> history(const std::string& name);

  /// The mesh belongs to the owner, as if one of the owner's jobs had it, until let_go().
  void hold(const std::string& owner, const std::string& digest) { owned_.add(owner, {digest}); }
  void let_go(const std::string& owner, const std::string& digest) { owned_.remove(owner, {digest}); }
  /// Whether a job of the owner has the mesh as an input or a result.
  Answer<bool> has_job_with(const std::string& owner, const std::string& digest);

  /// Whether jobs may have webhooks here.
  bool takes_webhooks() const { return settings_.check_webhook != nullptr; }
  /// Whether jobs may have a geometry here.
  bool takes_geometries() const;

  /// Starts no more jobs and asks the running jobs to end. If the store is durable, they become PENDING, and the next
  /// process continues them from their checkpoints; a job without a checkpoint starts again. Otherwise they are
  /// cancelled.
  /// `patience`: how long a job may go on to reach an iteration that can be saved as a checkpoint.
  void stop(std::chrono::milliseconds patience = std::chrono::milliseconds(10'000));
  /// Waits for the running jobs. Returns false if some still run at the deadline. If the store is durable, those are
  /// PENDING in the store by then and their attempts do not count as lost, so the process may end at once.
  bool drain(std::chrono::steady_clock::time_point deadline);

 private:
  struct Running {
    Claim claim;
    std::shared_ptr<EventLog> log;
    std::atomic<bool> cancelled = false;
    bool needs_device = false;  ///< The run waits for a device.
  };

  Answer<void> check(const v1::JobSpec& spec, bool is_admin);
  /// Tells of a job that may have ended.
  void note_end(const v1::Job& job) const {
    if (has_ended(job.state())) settings_.noted(job);
  }
  bool runs_here(const std::string& name);
  /// Tells a run that its job is cancelled. Returns false if the job does not run here.
  bool stop_running(const std::string& name);
  /// Refuses a stored mesh that takes more memory than all jobs have together.
  Answer<void> check_memory(const std::string& digest);
  Answer<void> check_geometry(const v1::JobSpec& spec, const Options& options);
  static Answer<void> check_layers(const v1::JobSpec& spec);
  Answer<void> check_webhook(const v1::JobSpec& spec) const;
  /// Changes a job in the store and adds the events to its log. `change` gets the last event number in use.
  Answer<Changed> change(const std::string& name, const std::function<Answer<Changed>(std::int64_t)>& change);
  void release(const std::vector<std::string>& digests);
  void forget(const Changed& removed);
  /// A running job begins, or stops, waiting for memory.
  void rest(const LentThreads& threads, bool rests);
  void run(const std::shared_ptr<Running>& running, const LentThreads& threads);
  /// Makes the job PENDING again, without the result of its attempt. Returns false if the store fails.
  bool give_back(const Running& running);
  /// Removes this attempt, and no other attempt at the same job, from the running ones.
  void erase(const Running& running);
  /// Records the end of an attempt. Returns false if the store cannot do so now.
  bool finish(const Running& running, const Ending& ending);
  /// Finishes the job when there is room for it. If the server stops before, gives it back.
  void finish_or_give_back(Running& running, const Ending& ending);
  void release(const Running& running, const Ending& ending);
  /// Deletes the jobs that ended too long ago.
  void forget_old();
  // leases.cpp:
  /// Whether a job must run where a device is.
  bool needs_device(const v1::JobSpec& spec) const;
  /// Whether a job that needs a device may be claimed: in a farm only if it would not wait for one here, since another
  /// server may have one that is free. `mutex_` is held.
  bool takes_job_for_device() const;
  /// Claims a job if fewer run than may run. Returns null if there is none.
  std::shared_ptr<Running> claim();
  void start_jobs();
  LentDevices own_devices() const;
  /// Tells the other servers of a farm which devices this one lends: its own, or none any more.
  void note_devices(bool lends);
  void tell_of_missing_devices();
  void renew_leases();
  void renew_lease(Running& running);
  /// Acts on what another process has done.
  void hear(const News& news);
  void take_back(const std::string& worker);

  JobStore* const jobs_;
  MeshStore* const meshes_;
  const Engine engine_;
  const SchedulerSettings settings_;
  MemoryBudget memory_;
  DeviceBudget devices_;
  Rate submissions_;
  JobLogs logs_;
  OwnedMeshes owned_;
  std::mutex mutex_;  ///< Never held while a store works.
  std::condition_variable ended_;
  std::map<std::string, std::shared_ptr<Running>> running_;
  int claiming_ = 0;             ///< Threads that claim a job.
  int claiming_for_device_ = 0;  ///< Those of them whose job may need a device.
  int resting_ = 0;              ///< Running jobs that wait for memory.
  int inside_ = 0;               ///< Those, and threads in run() or about to enter it.
  std::atomic<bool> stopping_ = false;
  std::atomic<std::chrono::milliseconds> stop_patience_ = std::chrono::milliseconds(0);  ///< Set before stopping_.
  SteadyTime next_renewal_{};                                                            ///< Used only by tick().
  bool listening_ = false;                                                               ///< Used only by tick().
};

}  // namespace varimesh::server
