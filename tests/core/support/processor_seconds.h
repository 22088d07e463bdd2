// How much processor time a piece of work takes, for tests of how the time grows with the input.
#pragma once

#include <algorithm>
#include <ctime>
#include <functional>

namespace varimesh::testing {

/// Processor seconds of the fastest of three tries.
inline double processor_seconds(const std::function<void()>& work) {
  double least = 1e9;
  for (int i = 0; i < 3; ++i) {
    const std::clock_t begun = std::clock();
    work();
    least = std::min(least, double(std::clock() - begun) / CLOCKS_PER_SEC);
  }
  return least;
}

}  // namespace varimesh::testing
