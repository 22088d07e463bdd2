// The guarantees of a watch. Each has a function that checks it in the record of a watcher and returns what is wrong;
// empty: nothing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/jobs/event_log.h"

namespace varimesh::server::testing {

/// The record of one stream: after which number it began, and its events.
struct WatchedStream {
  std::int64_t after_sequence = 0;
  std::vector<v1::JobEvent> events;
};

/// All streams of one watcher of one job, in order. Each continues after the last event of the previous one.
using WatchHistory = std::vector<WatchedStream>;

/// Returns whether no watcher may miss the event: states and quality reports.
inline bool must_be_delivered(const v1::JobEvent& event) { return event.has_state_change() || event.has_quality(); }

/// Ordered: the numbers in a stream increase. A bookmark has the number of the last event.
inline std::string broken_order(const WatchHistory& history) {
  for (const WatchedStream& stream : history) {
    std::int64_t last = stream.after_sequence;
    for (const v1::JobEvent& event : stream.events) {
      if (event.has_bookmark() ? event.sequence() != last : event.sequence() <= last)
        return "event " + std::to_string(event.sequence()) + " came after " + std::to_string(last);
      last = event.sequence();
    }
  }
  return {};
}

/// Unique: no number occurs twice in all streams together.
inline std::string broken_uniqueness(const WatchHistory& history) {
  std::map<std::int64_t, int> seen;
  for (const WatchedStream& stream : history)
    for (const v1::JobEvent& event : stream.events)
      if (!event.has_bookmark() && ++seen[event.sequence()] > 1)
        return "event " + std::to_string(event.sequence()) + " came twice";
  return {};
}

/// Reliable: all states and quality reports in `truth` were delivered unchanged.
inline std::string broken_reliability(const WatchHistory& history, const std::vector<v1::JobEvent>& truth) {
  std::map<std::int64_t, const v1::JobEvent*> came;
  for (const WatchedStream& stream : history)
    for (const v1::JobEvent& event : stream.events)
      if (!event.has_bookmark()) came[event.sequence()] = &event;
  for (const v1::JobEvent& event : truth) {
    if (!must_be_delivered(event)) continue;
    const auto found = came.find(event.sequence());
    if (found == came.end()) return "event " + std::to_string(event.sequence()) + " is missing";
    v1::JobEvent seen = *found->second, happened = event;
    seen.clear_thinned();
    happened.clear_thinned();
    if (seen.SerializeAsString() != happened.SerializeAsString())
      return "event " + std::to_string(event.sequence()) + " differs from what happened";
  }
  return {};
}

/// Resumable: a stream continues after the last event of the previous one, and the counts of skipped iterations explain
/// every gap in a range of numbers.
inline std::string broken_resumption(const WatchHistory& history) {
  std::int64_t last = 0;
  for (const WatchedStream& stream : history) {
    if (stream.after_sequence != last)
      return "a stream began after " + std::to_string(stream.after_sequence) + " and not after " + std::to_string(last);
    for (const v1::JobEvent& event : stream.events) {
      if (event.has_bookmark()) continue;
      const std::int64_t range = (event.sequence() - 1) / kSequenceRange * kSequenceRange;
      if (event.sequence() != std::max(last, range) + event.thinned() + 1)
        return "event " + std::to_string(event.sequence()) + " came after " + std::to_string(last) + " and says that " +
               std::to_string(event.thinned()) + " were thinned";
      last = event.sequence();
    }
  }
  return {};
}

/// Bookmarked: by their times, two consecutive messages of a stream are at most `most_seconds` apart.
inline std::string broken_bookmarks(const WatchHistory& history, std::int64_t most_seconds) {
  for (const WatchedStream& stream : history)
    for (std::size_t i = 1; i < stream.events.size(); ++i)
      if (stream.events[i].time().seconds() - stream.events[i - 1].time().seconds() > most_seconds)
        return "nothing came for more than " + std::to_string(most_seconds) + " s after event " +
               std::to_string(stream.events[i - 1].sequence());
  return {};
}

}  // namespace varimesh::server::testing
