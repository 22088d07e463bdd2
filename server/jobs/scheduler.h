// Which job runs when: takes submissions, starts workers, passes cancels on, forgets what is old.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/jobs/engine.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Everything the scheduler works with; time, names and threads are handed in, so that tests decide them.
struct SchedulerSettings {
  int threads = 1;         ///< The budget; as many jobs run at once at most.
  int max_pending = 1000;  ///< More are refused with QUEUE_FULL.
  int max_ended = 1000;    ///< Jobs that ended before this many others are forgotten with their results.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  std::function<std::string()> new_name;                               ///< "jobs/…", never the same again.
  std::function<void(int threads, std::function<void()> job)> launch;  ///< Runs the job elsewhere.
  std::function<void(const std::string& job, const std::string& what)> log = [](const auto&, const auto&) {};
};

/// One lock orders every change of a job's state with the event that tells of it.
class Scheduler {
 public:
  Scheduler(JobStore* jobs, MeshStore* meshes, Engine engine, SchedulerSettings settings);
  /// drain() must have returned true.
  ~Scheduler();

  /// Checks all that can be checked without running, and queues the job unless `validate_only`.
  Answer<v1::Job> submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only);
  Answer<v1::Job> get(const std::string& name);
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token);
  Answer<v1::Job> cancel(const std::string& name);
  Answer<v1::Job> remove(const std::string& name);
  JobCounts counts() { return jobs_->counts(); }

  Answer<std::shared_ptr<EventLog>> events(const std::string& name);
  /// All iterations of a job that SUCCEEDED.
  Answer<v1::History> history(const std::string& name);

  /// Claims nothing more and asks the running jobs to end.
  void stop();
  /// Waits for them; false where some still run at the deadline.
  bool drain(std::chrono::steady_clock::time_point deadline);

 private:
  struct Running {
    Claim claim;
    std::shared_ptr<EventLog> log;
    std::atomic<bool> cancelled = false;
  };

  Answer<void> check(const v1::JobSpec& spec);
  std::shared_ptr<EventLog> log_of(const std::string& name);
  void append_state(EventLog& log, v1::JobState state, int attempt, const v1::JobError* error = nullptr);
  void start_jobs();
  void run(const std::shared_ptr<Running>& running);
  void finish(const Running& running, const Ending& ending);
  void forget(const std::string& name);

  JobStore* const jobs_;
  MeshStore* const meshes_;
  const Engine engine_;
  const SchedulerSettings settings_;
  std::mutex mutex_;
  std::condition_variable ended_;
  std::map<std::string, std::shared_ptr<EventLog>> logs_;
  std::map<std::string, std::shared_ptr<Running>> running_;
  int inside_ = 0;  ///< Threads in run(), or about to be.
  bool stopping_ = false;
};

}  // namespace varimesh::server
