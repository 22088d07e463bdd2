// The threads of the machine, shared by the running jobs.
#pragma once

#include <functional>
#include <memory>

#include "server/resources/thread_shares.h"

namespace varimesh::server {

/// Runs each job on a thread of a pool. That thread sleeps while the library works in a oneTBB arena of the job; a job
/// with one thread works on the pool's thread itself. ThreadShares decides how large each arena may be, so many small
/// jobs can run side by side, and a large job uses all remaining cores.
class ThreadBudget {
 public:
  /// `threads`: the size of the budget. 0: as many as the machine has for this process.
  explicit ThreadBudget(int threads);
  ~ThreadBudget();

  int threads() const { return threads_; }
  /// Runs `job` with at most `threads` threads and returns at once. The job must not throw, and asks regularly how many
  /// threads it has. At most threads() jobs run at a time; others wait.
  void launch(int threads, std::function<void(const LentThreads& threads)> job);

 private:
  struct Control;
  int threads_;
  std::unique_ptr<Control> control_;
};

}  // namespace varimesh::server
