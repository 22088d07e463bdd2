// The threads that one optimisation may use.
#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

namespace varimesh {

/// A oneTBB arena of a given size. oneTBB does not count a thread that calls into an arena, so that two callers with a
/// budget of two would be four threads at work; here work is enqueued and the caller sleeps until it is done. A team of
/// one runs in the caller, without tasks.
class Team {
 public:
  /// `threads` 0: as many as the machine has.
  explicit Team(int threads)
      : threads_(threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {}

  int threads() const { return threads_; }

  /// Runs body() inside the arena and returns when it is done; for_each inside it uses the arena's threads.
  template <class Body>
  void run(Body&& body) {
    if (threads_ == 1) {
      body();
      return;
    }
    // Workers alone do the work, and by default oneTBB has one fewer of them than the machine has cores. Whoever has
    // set a limit already (a server with a budget for the machine) is left alone where it is enough.
    using Control = oneapi::tbb::global_control;
    const std::size_t needed = static_cast<std::size_t>(threads_) + 1;
    std::optional<Control> enough;
    if (Control::active_value(Control::max_allowed_parallelism) < needed)
      enough.emplace(Control::max_allowed_parallelism, needed);
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

 private:
  int threads_;
};

}  // namespace varimesh
