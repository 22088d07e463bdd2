// A team of threads: the threads that one piece of work may use, and the token that may stop it.
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

#include "core/base/stop_token.h"

namespace varimesh {

/// Makes oneTBB use up to `workers` worker threads. Its default is one fewer than the machine has cores, because the
/// calling thread works too. A lower limit that the program has set itself stays in force.
void ensure_workers(int workers);

/// A oneTBB arena of a given size. oneTBB does not count the thread that calls into an arena, so two callers with two
/// threads each would keep four threads busy. A team therefore enqueues the work, and the caller sleeps until it is
/// done. A team of one thread works in the caller, without tasks.
///
/// If the team has a token, for_each() and for_ranges() look at it between pieces of their work and throw Interrupted
/// if the work is to stop. So everything that a team does ends soon, wherever it is. Work that must not be left half
/// done takes the team without_stop().
class Team {
 public:
  /// @param threads how many threads; 0: as many as the machine has
  explicit Team(int threads) { set_threads(threads); }

  /// Must not be called during run().
  void set_threads(int threads) {
    threads_ = threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  }
  int threads() const { return threads_; }

  /// `stop` may be null, and must outlive the work. Must not be called during run().
  void set_stop(const StopToken* stop) { stop_ = stop; }
  const StopToken* stop() const { return stop_; }
  /// A look at the token, if there is one. Loops over long work look by themselves between calls of for_each().
  void look() const { varimesh::look(stop_); }
  /// The same threads without the token.
  Team without_stop() const { return Team(threads_); }

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
    const auto work = [&](std::int32_t begin, std::int32_t end) {
      const std::int32_t piece = std::max<std::int32_t>(1, grain / kLooksPerGrain);
      for (std::int32_t i = begin; i < end;) {
        look();
        for (const std::int32_t last = i + std::min(piece, end - i); i < last; ++i) body(i);
      }
    };
    if (threads_ == 1 || count <= grain)
      work(0, count);
    else
      oneapi::tbb::parallel_for(
          oneapi::tbb::blocked_range<std::int32_t>(0, count, grain),
          [&](const oneapi::tbb::blocked_range<std::int32_t>& range) { work(range.begin(), range.end()); });
  }

  /// Calls body(begin, end) for ranges that together make up 0 ≤ i < count. For work that needs memory per range.
  template <class Body>
  void for_ranges(std::size_t count, std::size_t grain, const Body& body) const {
    const auto work = [&](std::size_t begin, std::size_t end) {
      const std::size_t piece = stop_ == nullptr ? end - begin : std::max(grain, (end - begin) / kLooksPerRange + 1);
      for (std::size_t i = begin; i < end; i += piece) {
        look();
        body(i, std::min(end, i + piece));
      }
    };
    if (threads_ == 1 || count <= grain)
      work(0, count);
    else
      oneapi::tbb::parallel_for(
          oneapi::tbb::blocked_range<std::size_t>(0, count, grain),
          [&](const oneapi::tbb::blocked_range<std::size_t>& range) { work(range.begin(), range.end()); });
  }

 private:
  /// A grain of cells may take half a second at order 10.
  static constexpr std::int32_t kLooksPerGrain = 16;
  /// Ranges share memory between their pieces, so they are cut only as small as is needed for some milliseconds each.
  static constexpr std::size_t kLooksPerRange = 64;

  int threads_;
  const StopToken* stop_ = nullptr;
};

}  // namespace varimesh
