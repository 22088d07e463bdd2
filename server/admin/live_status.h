// What the live page shows of a running server, as JSON. It only reads, from the job store and the event logs.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "server/access/callers_view.h"
#include "server/failure.h"
#include "server/limits.h"
#include "server/scheduling/scheduler.h"

namespace varimesh::server {

/// The state of the server and of the jobs that are there for a caller. Thread-safe. However many pages are open, the
/// store is asked for the jobs of each owner at most once per `kStatusInterval`.
class LiveStatus {
 public:
  static constexpr std::chrono::milliseconds kStatusInterval{500};
  static constexpr int kMostEnded = 100;  ///< How many of the ended jobs are listed: the newest.

  LiveStatus(Scheduler* scheduler, const Limits& limits, std::function<TimePoint()> clock)
      : scheduler_(scheduler), limits_(limits), clock_(std::move(clock)), start_(clock_()) {}

  /// {"version", "start_time", "time", "threads", "max_pending_jobs", "pending", "running", "may_cancel",
  ///  "jobs": [{"job", "state", "labels", "priority", "attempt", "energy", "submitted", "began", "ended", "iteration":
  ///            {…}, "min_scaled_jacobian": [before, after], "error"}]}
  /// The jobs are the running ones, then the waiting ones, those of each peer in the order in which they will run,
  /// then the ended ones, newest first. Times are in milliseconds since 1970.
  Answer<std::string> status(const CallersView& view);

  /// {"sequence", "ended", "iterations": [[number, phase, energy, residual, min Js, seconds], …]}: the iterations of a
  /// running job after the event number `after`. NOT_FOUND if there is no such job.
  static Answer<std::string> iterations(const CallersView& view, const std::string& job, std::int64_t after);

 private:
  /// What was answered last, and when.
  struct Made {
    std::chrono::steady_clock::time_point time;
    Answer<std::string> status;
  };
  Answer<std::string> make_status(const CallersView& view) const;

  Scheduler* const scheduler_;
  const Limits& limits_;
  const std::function<TimePoint()> clock_;
  const TimePoint start_;
  std::mutex mutex_;  ///< Held while the status is made, so that other threads wait for the same status.
  std::map<std::string, Made> made_;  ///< By owner and right to cancel; "" for callers who see all jobs.
};

}  // namespace varimesh::server
