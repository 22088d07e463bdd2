// What there is to see of a running server, as JSON. It only reads, from the stores and the event logs.
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>

#include "server/failure.h"
#include "server/jobs/scheduler.h"
#include "server/operations/limits.h"

namespace varimesh::server {

/// Answers from any thread. However many watch, the store is asked for the list at most once in `kStatusInterval`.
class Watching {
 public:
  static constexpr std::chrono::milliseconds kStatusInterval{500};
  static constexpr int kMostEnded = 100;  ///< Of the jobs that have ended, the newest.

  Watching(Scheduler* scheduler, const Limits& limits, std::function<TimePoint()> clock)
      : scheduler_(scheduler), limits_(limits), clock_(std::move(clock)), start_(clock_()) {}

  /// {"version", "start_time", "time", "threads", "max_pending_jobs", "pending", "running",
  ///  "jobs": [{"job", "state", "labels", "priority", "attempt", "energy", "submitted", "began", "ended", "iteration":
  ///            {…}, "min_scaled_jacobian": [before, after], "error"}]}
  /// Jobs that run come first, then those that wait, in the order of their turns, then those that have ended, the
  /// newest first. Times are in milliseconds since 1970.
  Answer<std::string> status();

  /// {"sequence", "ended", "iterations": [[number, phase, energy, residual, min Js, seconds], …]}: those of a running
  /// job that follow the event `after`. NOT_FOUND where there is no such job.
  Answer<std::string> iterations(const std::string& job, std::int64_t after);

 private:
  Answer<std::string> make_status();

  Scheduler* const scheduler_;
  const Limits& limits_;
  const std::function<TimePoint()> clock_;
  const TimePoint start_;
  std::mutex mutex_;  ///< Held while the status is made: others wait for the same.
  std::chrono::steady_clock::time_point made_{};
  Answer<std::string> status_;
};

}  // namespace varimesh::server
