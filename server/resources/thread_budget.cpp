// A pool of threads for the jobs, and one global_control of oneTBB.
#include "server/resources/thread_budget.h"

#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>

#include "server/resources/pool.h"

namespace varimesh::server {

struct ThreadBudget::Control {
  // The limit includes one thread that calls into an arena. There is no such thread, hence the 1.
  explicit Control(int threads)
      : parallelism(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads) + 1),
        shares(threads),
        pool(threads) {}

  tbb::global_control parallelism;
  ThreadShares shares;
  Pool pool;  ///< The last member, so that its threads are joined before the others are destroyed.
};

ThreadBudget::ThreadBudget(int threads)
    : threads_(threads > 0 ? threads : std::max(1, tbb::info::default_concurrency())),
      control_(std::make_unique<Control>(threads_)) {}

ThreadBudget::~ThreadBudget() = default;

void ThreadBudget::launch(int threads, std::function<void(const LentThreads& threads)> job) {
  control_->pool.post([control = control_.get(), threads, job = std::move(job)] {
    const auto share = control->shares.take(threads);
    job({[&] { return share->threads(); }, [&](bool rests) { share->rest(rests); }});
  });
}

}  // namespace varimesh::server
