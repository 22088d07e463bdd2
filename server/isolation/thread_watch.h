// How many threads the processes of jobs have, and how much memory of a kind that no limit counts. A filter of system
// calls cannot count, and the system's own limits of threads count all processes of a user together, and root's not at
// all.
#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <cstdint>
#include <limits>
#include <map>
#include <mutex>
#include <thread>

namespace varimesh::server {

/// Kills processes that have more threads, or more of this memory, than they may. It looks fifty times a second, with a
/// thread of its own, which sleeps while there is nothing to watch. Thread-safe.
class ThreadWatch {
 public:
  ThreadWatch() = default;
  ~ThreadWatch();
  ThreadWatch(const ThreadWatch&) = delete;
  ThreadWatch& operator=(const ThreadWatch&) = delete;

  /// Threads beside those that compute: the first, the one that listens to the server, and some that are about to end.
  static constexpr int kMore = 10;

  /// Watches a child of this process. At most `computing` of its threads compute. Call forget() before anybody waits
  /// for the child's end.
  /// @param shared  most bytes of memory that it can share with others: RLIMIT_AS counts it, and RLIMIT_DATA does not
  void add(pid_t process, int computing, std::int64_t shared = std::numeric_limits<std::int64_t>::max());
  void forget(pid_t process);
  /// Why the process was killed, as ProcessLost says it; null: it was not.
  const char* why_killed(pid_t process) const;

 private:
  struct Watched {
    int most;
    std::int64_t shared;
    const char* why_killed = nullptr;
  };
  void run();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<pid_t, Watched> watched_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace varimesh::server
