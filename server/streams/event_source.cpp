// Reads events from the log.
#include "server/streams/event_source.h"

#include <utility>

#include "server/jobs/timestamps.h"

namespace varimesh::server {

Pull EventSource::pull(v1::JobEvent* event, bool idle) {
  switch (log_->next(cursor_, min_interval_, last_iteration_, event)) {
    case EventLog::Next::Event:
      cursor_ = event->sequence();
      if (event->has_iteration()) last_iteration_ = time_point(event->time());
      return Pull::Message;
    case EventLog::Next::End:
      return Pull::End;
    case EventLog::Next::Wait:
      break;
  }
  std::optional<v1::Work> work = new_work();
  if (!work && !idle) return Pull::Wait;
  event->set_sequence(cursor_);
  *event->mutable_time() = timestamp(std::chrono::system_clock::now());
  v1::Bookmark* bookmark = event->mutable_bookmark();
  if (work) *bookmark->mutable_work() = std::move(*work);
  return Pull::Message;
}

std::optional<v1::Work> EventSource::new_work() {
  const auto now = std::chrono::steady_clock::now();
  if (last_work_ && now - *last_work_ < min_interval_) return std::nullopt;
  std::optional<v1::Work> work = log_->work_after(works_seen_);
  if (work) last_work_ = now;
  return work;
}

}  // namespace varimesh::server
