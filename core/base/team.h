// A team of threads: the threads that one piece of work may use, and the token that may stop it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "core/base/stop_token.h"
#include "core/threads/crew.h"

namespace varimesh {

/// A number of threads, the caller included, that work on the same loops (crew.h).
///
/// If the team has a token, for_each() and for_ranges() look at it between pieces of their work and throw Interrupted
/// if the work is to stop. So everything that a team does ends soon, wherever it is. Work that must not be left half
/// done takes the team without_stop().
class Team {
 public:
  /// @param threads how many threads; 0: as many as the machine has for this process
  explicit Team(int threads) { set_threads(threads); }

  /// Must not be called during run().
  void set_threads(int threads) { threads_ = threads > 0 ? threads : machine_threads(); }
  int threads() const { return threads_; }

  /// `stop` may be null, and must outlive the work. Must not be called during run().
  void set_stop(const StopToken* stop) { stop_ = stop; }
  const StopToken* stop() const { return stop_; }
  /// A look at the token, if there is one. Loops over long work look by themselves between calls of for_each().
  void look() const { varimesh::look(stop_); }
  /// The same, together with other processes if the token is one of several (StopToken::stopped_together()). For the
  /// thread that runs the team, between loops.
  void look_together() const {
    if (stop_ != nullptr) stop_->look_together();
  }
  /// The same threads without the token.
  Team without_stop() const { return Team(threads_); }

  /// Runs body() on the calling thread. The threads of the team share the loops inside it.
  template <class Body>
  void run(Body&& body) const {
    std::optional<Crew::Opened> crew;
    if (threads_ > 1) crew.emplace(threads_);
    body();
  }

  /// Calls body(i) for 0 ≤ i < count in no particular order. A thread takes at least `grain` of them at a time.
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
      share(static_cast<std::size_t>(count), static_cast<std::size_t>(grain), [&](std::size_t begin, std::size_t end) {
        work(static_cast<std::int32_t>(begin), static_cast<std::int32_t>(end));
      });
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
      share(count, grain, work);
  }

 private:
  /// A grain of cells may take half a second at order 10.
  static constexpr std::int32_t kLooksPerGrain = 16;
  /// Ranges share memory between their pieces, so they are cut only as small as is needed for some milliseconds each.
  static constexpr std::size_t kLooksPerRange = 64;

  template <class Work>
  void share(std::size_t count, std::size_t grain, const Work& work) const {
    std::optional<Crew::Opened> own;
    if (Crew::current() == nullptr) own.emplace(threads_);
    Crew::current()->share(count, grain, LoopBody(work));
  }

  int threads_;
  const StopToken* stop_ = nullptr;
};

}  // namespace varimesh
