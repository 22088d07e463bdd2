// The guarantees of a watch, each with a validator of its own, run over what a watcher recorded.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/jobs/event_log.h"

namespace varimesh::server::testing {

/// One stream as its reader saw it: where it began, and what came.
struct WatchedStream {
  std::int64_t after_sequence = 0;
  std::vector<v1::JobEvent> events;
};

/// All streams of one watcher of one job, in order: each goes on after the last event of the one before.
using WatchHistory = std::vector<WatchedStream>;

/// States and quality reports are what no watcher may miss.
inline bool must_be_delivered(const v1::JobEvent& event) { return event.has_state_change() || event.has_quality(); }

/// Ordered: the numbers of a stream grow; a bookmark has that of the last event.
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

/// Unique: no number comes twice, over all streams.
inline std::string broken_uniqueness(const WatchHistory& history) {
  std::map<std::int64_t, int> seen;
  for (const WatchedStream& stream : history)
    for (const v1::JobEvent& event : stream.events)
      if (!event.has_bookmark() && ++seen[event.sequence()] > 1)
        return "event " + std::to_string(event.sequence()) + " came twice";
  return {};
}

/// Reliable: every state and quality report of `truth` came, as it was.
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

/// Resumable: a stream goes on after the last event of the one before, and what it thinned explains every gap in a
/// block of numbers.
inline std::string broken_resumption(const WatchHistory& history) {
  std::int64_t last = 0;
  for (const WatchedStream& stream : history) {
    if (stream.after_sequence != last)
      return "a stream began after " + std::to_string(stream.after_sequence) + " and not after " + std::to_string(last);
    for (const v1::JobEvent& event : stream.events) {
      if (event.has_bookmark()) continue;
      const std::int64_t block = (event.sequence() - 1) / kSequenceBlock * kSequenceBlock;
      if (event.sequence() != std::max(last, block) + event.thinned() + 1)
        return "event " + std::to_string(event.sequence()) + " came after " + std::to_string(last) + " and says that " +
               std::to_string(event.thinned()) + " were thinned";
      last = event.sequence();
    }
  }
  return {};
}

/// Bookmarked: no two messages of a stream are further apart than the contract allows, by their times.
inline std::string broken_bookmarks(const WatchHistory& history, std::int64_t most_seconds) {
  for (const WatchedStream& stream : history)
    for (std::size_t i = 1; i < stream.events.size(); ++i)
      if (stream.events[i].time().seconds() - stream.events[i - 1].time().seconds() > most_seconds)
        return "nothing came for more than " + std::to_string(most_seconds) + " s after event " +
               std::to_string(stream.events[i - 1].sequence());
  return {};
}

}  // namespace varimesh::server::testing
