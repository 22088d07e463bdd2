// The event logs of the jobs that run or are watched, in step with the job store.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/jobs/event_log.h"
#include "server/jobs/job_store.h"

namespace varimesh::server {

/// Makes the log of a job when somebody needs it, adds the events that the store has numbered, in their order, and
/// drops the logs of jobs that ended long ago. No lock of this object is held while the store works, except the one of
/// the job in question. Thread-safe.
class JobLogs {
 public:
  explicit JobLogs(JobStore* jobs) : jobs_(jobs) {}

  /// Returns the log of a job, with all events that the store has.
  Answer<std::shared_ptr<EventLog>> of(const std::string& name);
  /// Returns the log of a job if there is one.
  std::shared_ptr<EventLog> find(const std::string& name) const;
  /// Returns the log of a job that was just claimed. `events`: the events of the claim, in case the store fails.
  std::shared_ptr<EventLog> claimed(const std::string& name, std::vector<v1::JobEvent> events);

  /// Changes a job in the store and adds the events to its log. `change` gets the last event number in use.
  Answer<Changed> change(const std::string& name, const std::function<Answer<Changed>(std::int64_t last)>& change);
  /// Adds the events of a change that the store has already made, if the job has a log.
  void publish(const Changed& changed);
  /// Adds what another process has done with a job, if the job has a log: the events that the store has, and its newest
  /// iteration. The job must not run in this process, which would number its events.
  void follow(const std::string& name);
  /// The jobs whose logs somebody watches, without those that have ended.
  std::vector<std::string> watched() const;
  /// Drops the log of a job that was deleted.
  void forget(const std::string& name);

 private:
  struct Entry {
    std::shared_ptr<EventLog> log = std::make_shared<EventLog>();
    std::mutex loading;
    enum class State { Empty, Loaded, Failed } state = State::Empty;  ///< Guarded by `loading`.
  };

  /// Adds the events of the store that the log does not have. `known`: of these, if the store fails.
  void refresh(const std::string& name, EventLog& log, const std::vector<v1::JobEvent>& known);
  std::vector<v1::JobEvent> newer(const std::string& name, std::int64_t last, std::vector<v1::JobEvent> known);
  /// Closes the log if the job has ended.
  void close_ended(const std::string& name, EventLog& log);

  JobStore* const jobs_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
  std::deque<std::string> ended_;  ///< Of the closed logs, oldest first.
};

}  // namespace varimesh::server
