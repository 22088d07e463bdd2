// A pool of threads for the jobs.
#include "server/resources/thread_budget.h"

#include <utility>

#include "core/threads/crew.h"

namespace varimesh::server {

ThreadBudget::ThreadBudget(int threads)
    : threads_(threads > 0 ? threads : machine_threads()), shares_(threads_), pool_(2 * threads_) {}

void ThreadBudget::launch(int threads, std::function<void(const LentThreads& threads)> job) {
  pool_.post([this, threads, job = std::move(job)] {
    begin();
    const auto share = shares_.take(threads);
    job({[&] { return share->threads(); },
         [&](bool rests) {
           share->rest(rests);
           count(rests ? -1 : 1);
         }});
    count(-1);
  });
}

void ThreadBudget::begin() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return at_work_ < threads_; });
  ++at_work_;
}

void ThreadBudget::count(int jobs) {
  const std::scoped_lock lock(mutex_);
  at_work_ += jobs;
  changed_.notify_one();
}

}  // namespace varimesh::server
