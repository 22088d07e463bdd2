// Seconds since a moment, by a clock that no one sets.
#pragma once

#include <chrono>

namespace varimesh {

class Stopwatch {
 public:
  /// Runs from now.
  Stopwatch() = default;
  /// Runs as if it had been started this many seconds ago.
  static Stopwatch started(double seconds_ago) {
    Stopwatch watch;
    watch.start_ -= std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds_ago));
    return watch;
  }

  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace varimesh
