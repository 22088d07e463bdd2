// Measures elapsed seconds with a monotonic clock.
#pragma once

#include <chrono>

namespace varimesh {

class Stopwatch {
 public:
  /// Starts now.
  Stopwatch() = default;
  /// A stopwatch that was started this many seconds ago.
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
