// Several jobs at once: waiting for their ends, and how they ended all together.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "client/client.h"

namespace varimesh::client {

/// How many jobs ended in which way.
class Endings {
 public:
  void add(const v1::Job& job);
  /// For a job that somebody deleted before its end was seen.
  void add_deleted() { ++deleted_; }

  /// For example "100 jobs ended: 97 certified valid, 2 with elements that are not, 1 failed".
  std::string sentence() const;
  /// kJobFailed if a job failed, was cancelled or is gone; else kInvalidLeft if elements are left; else kDone.
  int exit_status() const;

 private:
  std::size_t valid_ = 0, left_ = 0, failed_ = 0, cancelled_ = 0, deleted_ = 0;
};

/// What wait_for_ends() tells its caller.
struct Waiting {
  std::function<void(const v1::Job&)> on_end;                            ///< A job has ended.
  std::function<void(const std::string&)> on_deleted;                    ///< Somebody has deleted a job; its name.
  std::function<void(std::size_t ended, std::size_t all)> on_look = {};  ///< After each look at the server.
};

/// Waits until all jobs have ended. Looks at the server every 0.3 s, or less often if looks take long: they take at
/// most a tenth of the time. Each job is reported once; jobs that have ended already come first. Errors: those of the
/// calls; Interrupted.
Outcome<void> wait_for_ends(Client* client, const std::vector<v1::Job>& jobs, const Waiting& waiting);

/// Sleeps, and returns early if there is an interrupt.
void sleep_unless_interrupted(std::chrono::milliseconds time);

}  // namespace varimesh::client
