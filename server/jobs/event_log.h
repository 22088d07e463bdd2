// What happened to one job, in order, and who wants to hear of it.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Hears that there is something new. Called from the thread that brought it; must not block.
class Listener {
 public:
  virtual ~Listener() = default;
  virtual void poke() = 0;
};

/// Numbers come in blocks, and a job whose server was lost goes on in the next one: nobody knows which numbers of the
/// block before were seen, nor of what.
inline constexpr std::int64_t kSequenceBlock = 1'000'000'000;

/// The events of one job. States, quality and log lines are kept; of the iterations the newest `max_iterations`. A
/// watcher has no queue of its own: it reads on from the last sequence number that it delivered, so that a slow one
/// costs nothing, and what it misses is the gap in the numbers, which holds iterations only.
class EventLog {
 public:
  /// Of the iterations kept, and of those a watcher may be behind before it is thinned.
  struct Limits {
    std::size_t max_iterations = 4096;
    std::size_t max_backlog = 1024;
  };

  EventLog() : EventLog(Limits{}) {}
  explicit EventLog(Limits limits) : limits_(limits) {}
  /// Of a job that was there before: what the job store has kept of it, in order.
  explicit EventLog(std::vector<v1::JobEvent> kept) : EventLog() { add(std::move(kept)); }

  /// Gives the event its sequence number, keeps it, tells the listeners.
  std::int64_t append(v1::JobEvent event);
  /// For events that the job store keeps and numbers: `store` is told the last number given, and no other is given
  /// until it returns; the events it returns are kept and told. It may wait for a disk: readers go on meanwhile.
  void append_stored(const std::function<std::vector<v1::JobEvent>(std::int64_t last_sequence)>& store);
  /// No event will follow: watchers that have delivered everything are at the end.
  void close();

  enum class Next { Event, Wait, End };
  /// The event to deliver after `after`, with the count of iterations thinned in between. An iteration is only
  /// delivered if its time is `min_interval` after `last_iteration` or later; a watcher far behind jumps to the newest
  /// ones.
  Next next(std::int64_t after, std::chrono::nanoseconds min_interval,
            std::chrono::system_clock::time_point last_iteration, v1::JobEvent* event) const;

  /// Whether a watch may go on after this number: it was given, and nothing behind it has been dropped. 0 always may.
  bool can_resume_after(std::int64_t sequence) const;
  std::int64_t last_sequence() const;
  /// The oldest event that is kept and has nothing dropped behind it.
  std::int64_t oldest_sequence() const;

  void subscribe(std::weak_ptr<Listener> listener);

 private:
  void add(std::vector<v1::JobEvent> events);
  void notify();

  const Limits limits_;
  std::mutex numbers_;  ///< Held by who gives a number, until the event is there. Taken before the other.
  mutable std::mutex mutex_;
  std::int64_t last_sequence_ = 0;
  std::int64_t dropped_through_ = 0;  ///< The newest iteration that is not kept any more.
  bool closed_ = false;
  std::vector<v1::JobEvent> kept_;       ///< States, quality, log lines.
  std::deque<v1::JobEvent> iterations_;  ///< The newest of them.
  std::vector<std::weak_ptr<Listener>> listeners_;
};

/// A point in time as the messages have it, and back.
google::protobuf::Timestamp timestamp(std::chrono::system_clock::time_point time);
std::chrono::system_clock::time_point time_point(const google::protobuf::Timestamp& time);

}  // namespace varimesh::server
