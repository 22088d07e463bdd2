// How many threads a piece of work can feed.
#pragma once

#include <algorithm>

namespace varimesh::server {

/// A run gets one thread, and one more for every so many pairs of nodes that share a cell. Measured with two threads on
/// two cores: from 9e5 pairs on, the clock's time falls by 1.5 to 1.9 times on an idle machine, and by 1.0 to 1.3 times
/// beside two programs that keep both cores busy. Runs of 2e5 to 3e5 pairs gain 1.2 to 1.4 times on an idle machine,
/// but take more than 2.2 times as long beside the two programs. Between 3e5 and 9e5 pairs nothing was measured.
inline constexpr double kPairsPerThread = 4e5;

/// The same for the bytes of a file that is read.
inline constexpr double kBytesPerThread = 1e6;

inline int most_threads(double work, double per_thread) {
  return 1 + static_cast<int>(std::min(work / per_thread, 1e6));
}

}  // namespace varimesh::server
