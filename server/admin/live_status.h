// What the live page shows of a running server, as JSON. It only reads, from the job store and the event logs.
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>

#include "server/failure.h"
#include "server/limits.h"
#include "server/scheduling/scheduler.h"

namespace varimesh::server {

/// The state of the server and of its jobs. Thread-safe. However many pages are open, the store is asked for the jobs
/// at most once per `kStatusInterval`.
class LiveStatus {
 public:
  static constexpr std::chrono::milliseconds kStatusInterval{500};
  static constexpr int kMostEnded = 100;  ///< How many of the ended jobs are listed: the newest.

  LiveStatus(Scheduler* scheduler, const Limits& limits, std::function<TimePoint()> clock)
      : scheduler_(scheduler), limits_(limits), clock_(std::move(clock)), start_(clock_()) {}

  /// {"version", "start_time", "time", "threads", "max_pending_jobs", "pending", "running",
  ///  "jobs": [{"job", "state", "labels", "priority", "attempt", "energy", "submitted", "began", "ended", "iteration":
  ///            {…}, "min_scaled_jacobian": [before, after], "error"}]}
  /// The jobs are the running ones, then the waiting ones in the order in which they will run, then the ended ones,
  /// newest first. Times are in milliseconds since 1970.
  Answer<std::string> status();

  /// {"sequence", "ended", "iterations": [[number, phase, energy, residual, min Js, seconds], …]}: the iterations of a
  /// running job after the event number `after`. NOT_FOUND if there is no such job.
  Answer<std::string> iterations(const std::string& job, std::int64_t after);

 private:
  Answer<std::string> make_status();

  Scheduler* const scheduler_;
  const Limits& limits_;
  const std::function<TimePoint()> clock_;
  const TimePoint start_;
  std::mutex mutex_;  ///< Held while the status is made, so that other threads wait for the same status.
  std::chrono::steady_clock::time_point made_{};
  Answer<std::string> status_;
};

}  // namespace varimesh::server
