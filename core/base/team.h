// The threads that one piece of work may use.
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

/// Sees to it that oneTBB has `workers` worker threads; by default it has one fewer than the machine has cores, since
/// it counts on the caller. A lower limit that the program has set for itself holds all the same.
void ensure_workers(int workers);

/// A oneTBB arena of a given size. oneTBB does not count a thread that calls into an arena, so that two callers with a
/// budget of two would be four threads at work; here work is enqueued and the caller sleeps until it is done. A team of
/// one runs in the caller, without tasks.
class Team {
 public:
  /// `threads` 0: as many as the machine has.
  explicit Team(int threads) { set_threads(threads); }

  /// Not while run() is under way.
  void set_threads(int threads) {
    threads_ = threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  }
  int threads() const { return threads_; }

  /// Runs body() inside the arena and returns when it is done; for_each inside it uses the arena's threads. What body
  /// throws is thrown here.
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

  /// Calls body(i) for 0 ≤ i < count, at least `grain` of them a task, in no particular order.
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

  /// Calls body(begin, end) for ranges that make up 0 ≤ i < count, for work that wants scratch a range.
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
