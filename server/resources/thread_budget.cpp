// A pool of threads for the jobs.
#include "server/resources/thread_budget.h"

#include <utility>

#include "core/threads/crew.h"

namespace varimesh::server {

ThreadBudget::ThreadBudget(int threads)
    : threads_(threads > 0 ? threads : machine_threads()), shares_(threads_), pool_(threads_) {}

void ThreadBudget::launch(int threads, std::function<void(const LentThreads& threads)> job) {
  pool_.post([this, threads, job = std::move(job)] {
    const auto share = shares_.take(threads);
    job({[&] { return share->threads(); }, [&](bool rests) { share->rest(rests); }});
  });
}

}  // namespace varimesh::server
