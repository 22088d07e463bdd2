// How much processor time a piece of work takes, for tests of how the time grows with the input.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <functional>

namespace varimesh::testing {

/// Processor seconds of this process and of the programs that it has started and that have ended.
inline double processor_seconds_so_far() {
  double sum = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    ::getrusage(who, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      sum += double(time.tv_sec) + 1e-6 * double(time.tv_usec);
  }
  return sum;
}

/// Processor seconds of the fastest of three tries.
inline double processor_seconds(const std::function<void()>& work) {
  double least = 1e9;
  for (int i = 0; i < 3; ++i) {
    const double begun = processor_seconds_so_far();
    work();
    least = std::min(least, processor_seconds_so_far() - begun);
  }
  return least;
}

}  // namespace varimesh::testing
