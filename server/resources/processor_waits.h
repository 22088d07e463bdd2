// Whether the threads of this process have to wait for processors, as they do if other programs compute too.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace varimesh::server {

/// Compares how long the threads of this process have run with how long they were ready to run and had to wait for a
/// processor. Linux counts both (/proc/self/task/*/schedstat, with CONFIG_SCHED_INFO). Without these files a machine
/// never counts as crowded. Not thread-safe.
class ProcessorWaits {
 public:
  /// `tasks`: the folder with one folder per thread.
  explicit ProcessorWaits(std::filesystem::path tasks = "/proc/self/task");

  /// Whether the threads have waited for more than a quarter of the time that they have run, since the last answer or
  /// the start. The answer stays the same until they have run and waited for 20 ms. That is about as long as a few
  /// turns on a processor.
  bool crowded();

 private:
  /// Nanoseconds of all threads together.
  struct Sums {
    std::int64_t ran = 0, waited = 0;
  };
  std::optional<Sums> sums() const;

  std::filesystem::path tasks_;
  std::optional<Sums> last_;
  bool crowded_ = false;
};

}  // namespace varimesh::server
