// A pool of threads to wait on, and one global_control.
#include "server/jobs/thread_budget.h"

#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <mutex>
#include <optional>

#include "server/jobs/pool.h"

namespace varimesh::server {

struct ThreadBudget::Control {
  explicit Control(int threads) : threads(threads), pool(threads) { limit(); }

  /// Gives oneTBB what the single-threaded jobs leave, but never nothing: somebody may wait for it.
  void limit() {
    // The limit counts one thread that calls into an arena, and nobody does: hence one more. Of several controls the
    // smallest value counts, so the old one goes first.
    const auto workers = static_cast<std::size_t>(std::max(1, threads - singles));
    parallelism.reset();
    parallelism.emplace(tbb::global_control::max_allowed_parallelism, workers + 1);
  }

  void count_single(int change) {
    const std::lock_guard lock(mutex);
    singles += change;
    limit();
  }

  const int threads;
  std::mutex mutex;
  int singles = 0;
  std::optional<tbb::global_control> parallelism;
  Pool pool;  ///< Last, so that its threads are joined before the rest goes.
};

ThreadBudget::ThreadBudget(int threads)
    : threads_(threads > 0 ? threads : std::max(1, tbb::info::default_concurrency())),
      control_(std::make_unique<Control>(threads_)) {}

ThreadBudget::~ThreadBudget() = default;

void ThreadBudget::launch(int threads, std::function<void()> job) {
  control_->pool.post([control = control_.get(), single = threads == 1, job = std::move(job)] {
    if (single) control->count_single(1);
    job();
    if (single) control->count_single(-1);
  });
}

}  // namespace varimesh::server
