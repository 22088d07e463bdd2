// The threads of the machine, shared by the running jobs.
#pragma once

#include <functional>

#include "server/resources/pool.h"
#include "server/resources/thread_shares.h"

namespace varimesh::server {

/// Runs each job on a thread of a pool, which is one of the job's threads. ThreadShares decides how many each job has,
/// so many small jobs can run side by side, and a large job uses all remaining cores.
class ThreadBudget {
 public:
  /// `threads`: the size of the budget. 0: as many as the machine has for this process.
  explicit ThreadBudget(int threads);

  int threads() const { return threads_; }
  /// Runs `job` with at most `threads` threads and returns at once. The job must not throw, and asks regularly how many
  /// threads it has. At most threads() jobs run at a time; others wait.
  void launch(int threads, std::function<void(const LentThreads& threads)> job);

 private:
  int threads_;
  ThreadShares shares_;
  Pool pool_;  ///< The last member, so that its threads are joined before the others are destroyed.
};

}  // namespace varimesh::server
