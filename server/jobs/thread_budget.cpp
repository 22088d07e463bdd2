// Arenas under one global_control.
#include "server/jobs/thread_budget.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace varimesh::server {

// The limit counts one thread that calls in, and none does: hence one more.
struct ThreadBudget::Control {
  explicit Control(int threads)
      : parallelism(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads) + 1) {}
  tbb::global_control parallelism;
};

ThreadBudget::ThreadBudget(int threads)
    : threads_(threads > 0 ? threads : std::max(1, tbb::info::default_concurrency())),
      control_(std::make_unique<Control>(threads_)) {}

ThreadBudget::~ThreadBudget() = default;

void ThreadBudget::launch(int threads, std::function<void()> job) {
  // No slot is reserved for a caller. The task holds the arena until the job is over.
  auto arena = std::make_shared<tbb::task_arena>(std::clamp(threads, 1, threads_), 0);
  arena->enqueue([arena, job = std::move(job)] { job(); });
}

}  // namespace varimesh::server
