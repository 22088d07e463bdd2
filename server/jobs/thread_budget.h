// One budget of threads for the machine, shared by the jobs that run.
#pragma once

#include <functional>
#include <memory>

namespace varimesh::server {

/// Runs each job in a oneTBB arena of its own under one limit for all of them, so that many small jobs run side by side
/// and a large one uses every core. Jobs are enqueued, never executed by the caller: oneTBB does not count a thread
/// that calls into an arena, and the budget would be overdrawn by one thread a job.
class ThreadBudget {
 public:
  /// `threads` 0: as many as the machine has for this process.
  explicit ThreadBudget(int threads);
  ~ThreadBudget();

  int threads() const { return threads_; }
  /// Runs `job`, which must not throw, with at most `threads` of the budget; returns at once.
  void launch(int threads, std::function<void()> job);

 private:
  struct Control;
  int threads_;
  std::unique_ptr<Control> control_;
};

}  // namespace varimesh::server
