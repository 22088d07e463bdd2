// The events of one job, in order, and the listeners that are told of new ones.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// Is told when there may be something new. Called from the thread that adds the event.
class Listener {
 public:
  virtual ~Listener() = default;
  /// Must not block.
  virtual void poke() = 0;
};

/// Event numbers are divided into ranges of this size. A job whose server was lost continues in the next range, since
/// nobody knows which numbers of the previous range clients have seen, or for which events.
inline constexpr std::int64_t kSequenceRange = 1'000'000'000;

/// The events of one job. All states, quality reports and log lines are kept, and the newest `max_iterations`
/// iterations. A watcher has no queue: it continues from the last number that it delivered, so a slow watcher costs
/// nothing. A gap in the numbers shows what it has missed, which is only iterations. Thread-safe.
class EventLog {
 public:
  /// How many iterations are kept, and how many a watcher may be behind before some are skipped.
  struct Limits {
    std::size_t max_iterations = 4096;
    std::size_t max_backlog = 1024;
  };

  EventLog() : EventLog(Limits{}) {}
  explicit EventLog(Limits limits) : limits_(limits) {}
  /// The log of a job with earlier events, which the job store has kept, in order.
  explicit EventLog(std::vector<v1::JobEvent> kept) : EventLog() { add(std::move(kept)); }

  /// Gives the event its number, stores it, and tells the listeners. Returns the number.
  std::int64_t append(v1::JobEvent event);
  /// Adds events that the job store keeps and numbers. `store` gets the last number in use and returns the events; no
  /// other numbers are given until it returns. It may wait for a disk, while readers continue.
  void append_stored(const std::function<std::vector<v1::JobEvent>(std::int64_t last_sequence)>& store);
  /// How far the run is. It has no number, is not kept, and holds only until the next event. Tells the listeners.
  void set_work(v1::Work work);
  /// Returns the work if it is newer than number `seen`, which becomes its number.
  std::optional<v1::Work> work_after(std::int64_t& seen) const;
  /// Somebody wants to see the mesh of the running job. Returns the newest that the run has shown
  /// (RunHooks::show_mesh); null if there is none yet. It is forgotten when the log is closed, or the attempt ends.
  std::shared_ptr<const std::string> watch_mesh();
  /// Whether somebody has wanted to see the mesh within the last seconds.
  bool is_mesh_watched() const;
  /// Keeps what the run shows, in place of what it showed before; null: it shows nothing any more.
  void show_mesh(std::shared_ptr<const std::string> bytes);
  /// States that no events will follow, so that watchers that have delivered everything are at the end.
  /// Returns whether this was not stated before.
  bool close();
  /// The newest state of the job; unspecified if no event says.
  v1::JobState state() const;

  enum class Next { Event, Wait, End };
  /// Finds the next event after number `after`, with the number of iterations that were skipped. An iteration is
  /// delivered only if its time is at least `min_interval` after `last_iteration`. A watcher that is far behind skips
  /// to the newest iterations.
  Next next(std::int64_t after, std::chrono::nanoseconds min_interval,
            std::chrono::system_clock::time_point last_iteration, v1::JobEvent* event) const;

  /// Returns whether a watch can continue after this number: it was given, and no later event has been dropped. Always
  /// true for 0.
  bool can_resume_after(std::int64_t sequence) const;
  std::int64_t last_sequence() const;
  /// The number of the oldest kept event after which no event has been dropped.
  std::int64_t oldest_sequence() const;

  /// Whether somebody listens, and events may follow.
  bool is_watched() const;
  /// Adds a listener. It is removed when it no longer exists.
  void subscribe(std::weak_ptr<Listener> listener);

 private:
  void add(std::vector<v1::JobEvent> events);
  /// Requires mutex_. The event has its number.
  void keep(v1::JobEvent event);
  void notify();

  const Limits limits_;
  std::mutex numbers_;  ///< Held from giving a number until the event is stored. Locked before mutex_.
  mutable std::mutex mutex_;
  std::int64_t last_sequence_ = 0;
  std::int64_t dropped_through_ = 0;  ///< The number of the newest iteration that was dropped.
  bool closed_ = false;
  std::vector<v1::JobEvent> kept_;           ///< States, quality, log lines.
  std::deque<v1::JobEvent> iterations_;      ///< The newest ones.
  std::shared_ptr<const std::string> mesh_;  ///< The newest that the run has shown.
  std::optional<std::chrono::steady_clock::time_point> mesh_watched_;
  std::optional<v1::Work> work_;  ///< The newest, if no event has come since.
  std::int64_t works_ = 0;        ///< How many there have been.
  std::vector<std::weak_ptr<Listener>> listeners_;
};

}  // namespace varimesh::server
