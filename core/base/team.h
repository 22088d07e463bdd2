// A team of threads: the threads that one piece of work may use.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>

namespace varimesh {

/// Makes oneTBB use up to `workers` worker threads. Its default is one fewer than the machine has cores, because the
/// calling thread works too. A lower limit that the program has set itself stays in force.
void ensure_workers(int workers);

/// A oneTBB arena of a given size. oneTBB does not count the thread that calls into an arena, so two callers with two
/// threads each would keep four threads busy. A team therefore enqueues the work, and the caller sleeps until it is
/// done. A team of one thread works in the caller, without tasks.
class Team {
 public:
  /// @param threads how many threads; 0: as many as the machine has
  explicit Team(int threads) { set_threads(threads); }

  /// Must not be called during run().
  void set_threads(int threads) {
    threads_ = threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  }
  int threads() const { return threads_; }

  /// Runs body() inside the arena and returns when it is done. for_each() and for_ranges() inside body() use the
  /// arena's threads. An exception from body() is rethrown here.
  template <class Body>
  void run(Body&& body) const {
    if (threads_ == 1) {
      body();
      return;
    }
    ensure_workers(threads_);
    oneapi::tbb::task_arena arena(threads_, 0);
    std::mutex mutex;
    std::condition_variable done_changed;
    bool done = false;
    std::exception_ptr failure;
    arena.enqueue([&] {
      try {
        body();
      } catch (...) {
        failure = std::current_exception();
      }
      const std::scoped_lock lock(mutex);
      done = true;
      done_changed.notify_one();
    });
    std::unique_lock lock(mutex);
    done_changed.wait(lock, [&] { return done; });
    if (failure) std::rethrow_exception(failure);
  }

  /// Calls body(i) for 0 ≤ i < count in no particular order. Each task takes at least `grain` of them.
  template <class Body>
  void for_each(std::int32_t count, std::int32_t grain, const Body& body) const {
    if (threads_ == 1 || count <= grain) {
      for (std::int32_t i = 0; i < count; ++i) body(i);
      return;
    }
    oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::int32_t>(0, count, grain),
                              [&](const oneapi::tbb::blocked_range<std::int32_t>& range) {
                                for (std::int32_t i = range.begin(); i != range.end(); ++i) body(i);
                              });
  }

  /// Calls body(begin, end) for ranges that together make up 0 ≤ i < count. For work that needs memory per range.
  template <class Body>
  void for_ranges(std::size_t count, std::size_t grain, const Body& body) const {
    if (threads_ == 1 || count <= grain) {
      if (count > 0) body(std::size_t{0}, count);
      return;
    }
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<std::size_t>(0, count, grain),
        [&](const oneapi::tbb::blocked_range<std::size_t>& range) { body(range.begin(), range.end()); });
  }

 private:
  int threads_;
};

}  // namespace varimesh
