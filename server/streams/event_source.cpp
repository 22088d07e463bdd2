// Reads events from the log.
#include "server/streams/event_source.h"

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
  if (!idle) return Pull::Wait;
  event->set_sequence(cursor_);
  *event->mutable_time() = timestamp(std::chrono::system_clock::now());
  event->mutable_bookmark();
  return Pull::Message;
}

}  // namespace varimesh::server
