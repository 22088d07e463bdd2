// How many threads the processes of jobs have. A filter of system calls cannot count, and the system's own limits count
// all processes of a user together, and root's not at all.
#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>

namespace varimesh::server {

/// Kills processes that have more threads than they may. It looks fifty times a second, with a thread of its own, which
/// sleeps while there is nothing to watch. Thread-safe.
class ThreadWatch {
 public:
  ThreadWatch() = default;
  ~ThreadWatch();
  ThreadWatch(const ThreadWatch&) = delete;
  ThreadWatch& operator=(const ThreadWatch&) = delete;

  /// Beside those that compute: the first, the one that listens to the server, and some that are about to end.
  static constexpr int kMore = 10;

  /// Watches a child of this process. At most `computing` of its threads compute. Call forget() before anybody waits
  /// for the child's end.
  void add(pid_t process, int computing);
  void forget(pid_t process);
  /// Whether the process was killed because it had too many.
  bool has_killed(pid_t process) const;

 private:
  struct Watched {
    int most;
    bool killed = false;
  };
  void run();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<pid_t, Watched> watched_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace varimesh::server
