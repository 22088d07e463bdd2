// The events of a job as the source of a stream. WatchJob and Optimise share it.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "server/jobs/event_log.h"
#include "server/streams/pump.h"

namespace varimesh::server {

/// A reader's position in the events of a job.
class EventSource {
 public:
  EventSource(std::shared_ptr<EventLog> log, std::int64_t after, std::chrono::nanoseconds min_interval)
      : log_(std::move(log)), cursor_(after), min_interval_(min_interval) {}

  /// Returns the next event, or a bookmark if there is no event and the run has come further with its work, or `idle`
  /// says that a bookmark is due.
  Pull pull(v1::JobEvent* event, bool idle);

 private:
  /// The work of the run, if it is new and the last was delivered at least the interval ago.
  std::optional<v1::Work> new_work();

  const std::shared_ptr<EventLog> log_;
  std::int64_t cursor_;
  const std::chrono::nanoseconds min_interval_;
  std::chrono::system_clock::time_point last_iteration_{};
  std::optional<std::chrono::steady_clock::time_point> last_work_;  ///< When the last work was delivered.
  std::int64_t works_seen_ = 0;
};

}  // namespace varimesh::server
