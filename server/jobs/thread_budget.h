// One budget of threads for the machine, shared by the jobs that run.
#pragma once

#include <functional>
#include <memory>

namespace varimesh::server {

/// Runs each job on a thread that sleeps while the library works in a oneTBB arena of the job's own; all arenas share
/// one limit, so that many small jobs run side by side and a large one uses every core. A job of one thread works on
/// the thread it was given, and the limit for the others is lowered by one meanwhile.
class ThreadBudget {
 public:
  /// `threads` 0: as many as the machine has for this process.
  explicit ThreadBudget(int threads);
  ~ThreadBudget();

  int threads() const { return threads_; }
  /// Runs `job`, which must not throw and will use at most `threads`; returns at once. At most threads() jobs run at a
  /// time, and others wait.
  void launch(int threads, std::function<void()> job);

 private:
  struct Control;
  int threads_;
  std::unique_ptr<Control> control_;
};

}  // namespace varimesh::server
