// The threads of the machine, shared by the running jobs.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>

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
  /// threads it has. At most threads() jobs run at a time, beside as many that rest; others wait.
  void launch(int threads, std::function<void(const LentThreads& threads)> job);

 private:
  /// Waits until fewer jobs are at work than there are threads.
  void begin();
  /// So many more jobs are at work.
  void count(int jobs);

  int threads_;
  ThreadShares shares_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int at_work_ = 0;
  Pool pool_;  ///< The last member, so that its threads are joined before the others are destroyed.
};

}  // namespace varimesh::server
