// A job's events as a stream is fed with them; WatchJob and Optimise share it.
#pragma once

#include <chrono>
#include <memory>

#include "server/api/pump.h"
#include "server/jobs/event_log.h"

namespace varimesh::server {

/// A reading position in a job's events.
class EventSource {
 public:
  EventSource(std::shared_ptr<EventLog> log, std::int64_t after, std::chrono::nanoseconds min_interval)
      : log_(std::move(log)), cursor_(after), min_interval_(min_interval) {}

  /// The next event; a bookmark where there is none and one is due.
  Pull pull(v1::JobEvent* event, bool idle);

 private:
  const std::shared_ptr<EventLog> log_;
  std::int64_t cursor_;
  const std::chrono::nanoseconds min_interval_;
  std::chrono::system_clock::time_point last_iteration_{};
};

}  // namespace varimesh::server
