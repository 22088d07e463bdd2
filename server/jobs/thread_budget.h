// One budget of threads for the machine, shared by the jobs that run.
#pragma once

#include <functional>
#include <memory>

#include "server/jobs/thread_shares.h"

namespace varimesh::server {

/// Runs each job on a thread that sleeps while the library works in a oneTBB arena of the job's own; a job that has one
/// thread works on the thread it was given. ThreadShares says how large an arena may be, so that many small jobs run
/// side by side and a large one uses every core that is left.
class ThreadBudget {
 public:
  /// `threads` 0: as many as the machine has for this process.
  explicit ThreadBudget(int threads);
  ~ThreadBudget();

  int threads() const { return threads_; }
  /// Runs `job`, which must not throw, asks now and then how many threads it has, and wants no more than `threads`;
  /// returns at once. At most threads() jobs run at a time, and others wait.
  void launch(int threads, std::function<void(const LentThreads& threads)> job);

 private:
  struct Control;
  int threads_;
  std::unique_ptr<Control> control_;
};

}  // namespace varimesh::server
