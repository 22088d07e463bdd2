// Which job runs when: takes submissions, starts workers, passes cancels on, forgets what is old.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/jobs/engine.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/thread_shares.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Everything the scheduler works with; time, names and threads are handed in, so that tests decide them.
struct SchedulerSettings {
  int threads = 1;                     ///< The budget; as many jobs run at once at most.
  int max_pending = 1000;              ///< More are refused with QUEUE_FULL.
  int max_pending_of_owner = 0;        ///< Likewise, of one owner, with PEER_LIMIT; 0: no limit.
  int max_ended = 1000;                ///< Jobs that ended before this many others are forgotten with their results.
  std::string worker = "local";        ///< Whose claims these are, after a restart too.
  std::chrono::seconds heartbeat{10};  ///< A third of the lease.
  std::chrono::milliseconds checkpoint_pause{5'000};  ///< Between two checkpoints of a job, at least.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  std::function<bool()> has_room = [] { return true; };  ///< On the disk, for another job; STORE_FULL where not.
  std::function<std::string()> new_name;                 ///< "jobs/…", never the same again; from any thread.
  std::int64_t memory = 0;                               ///< Bytes that the jobs may have together; 0: no limit.
  /// A job that may use up to so many threads, and is told what it has; run elsewhere.
  using Job = std::function<void(const LentThreads& threads)>;
  std::function<void(int threads, Job job)> launch;
  std::function<void(const std::string& job, const std::string& what)> log = [](const auto&, const auto&) {};
};

/// One lock orders every change of a job's state with the event that tells of it.
class Scheduler {
 public:
  Scheduler(JobStore* jobs, MeshStore* meshes, Engine engine, SchedulerSettings settings);
  /// drain() must have returned true.
  ~Scheduler();

  /// First of all, and before anybody asks: takes back the jobs that ran when the process before this one ended, and
  /// counts what the jobs refer to. tick() then starts them.
  Answer<void> recover();
  /// About once a second: renews leases, takes back what was lost, starts what waits.
  void tick();

  /// Checks all that can be checked without running, and queues the job unless `validate_only`. `owner`: whose it is,
  /// for the limits of one owner.
  Answer<v1::Job> submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only,
                         const std::string& owner = {});
  Answer<v1::Job> get(const std::string& name);
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token);
  Answer<v1::Job> cancel(const std::string& name);
  Answer<v1::Job> remove(const std::string& name);
  Answer<JobCounts> counts() { return jobs_->counts(); }

  Answer<std::shared_ptr<EventLog>> events(const std::string& name);
  /// All iterations of a job that SUCCEEDED.
  Answer<v1::History> history(const std::string& name);

  /// Claims nothing more and asks the running jobs to end. Where the store is durable they wait again, and the next
  /// process goes on from their checkpoints; a job that has none starts again from its beginning. Otherwise they are
  /// cancelled.
  void stop();
  /// Waits for them; false where some still run at the deadline. Where the store is durable those are PENDING there by
  /// then, and no attempt counts as lost: the process may end at once.
  bool drain(std::chrono::steady_clock::time_point deadline);

 private:
  struct Running {
    Claim claim;
    std::shared_ptr<EventLog> log;
    std::atomic<bool> cancelled = false;
  };

  Answer<void> check(const v1::JobSpec& spec);
  // With the lock held:
  /// Changes a job in the store, and tells whoever watches it. `change` is given the last number that was used.
  Answer<Changed> change(const std::string& name, const std::function<Answer<Changed>(std::int64_t)>& change);
  void tell(const Changed& changed);
  Answer<std::shared_ptr<EventLog>> log_of(const std::string& name);
  void close(const std::string& name, EventLog& log);
  void forget(const Changed& removed);
  std::shared_ptr<Running> claim();

  void start_jobs();
  void run(const std::shared_ptr<Running>& running, const LentThreads& threads);
  /// With the lock held: lets the job wait again, without its attempt's result. False where the store could not take
  /// it.
  bool give_back(const Running& running);
  /// With the lock held: takes this attempt, and no other of the same job, from those that run.
  void erase(const Running& running);
  /// False where the store could not take it now.
  bool finish(const Running& running, const Ending& ending);
  void release(const Ending& ending);
  void heartbeats();
  void take_back(const std::string& worker);

  JobStore* const jobs_;
  MeshStore* const meshes_;
  const Engine engine_;
  const SchedulerSettings settings_;
  MemoryBudget memory_;
  std::mutex mutex_;
  std::condition_variable ended_;
  std::map<std::string, std::shared_ptr<EventLog>>
      logs_;  ///< Of those that somebody watches or runs, and the last ended.
  std::deque<std::string> ended_logs_;
  std::map<std::string, std::shared_ptr<Running>> running_;
  int inside_ = 0;  ///< Threads in run(), or about to be.
  std::atomic<bool> stopping_ = false;
  TimePoint next_heartbeat_{};  ///< By tick() alone.
};

}  // namespace varimesh::server
