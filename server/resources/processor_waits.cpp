// Adds up the times that the system counts for each thread.
#include "server/resources/processor_waits.h"

#include <fstream>
#include <system_error>
#include <utility>

namespace varimesh::server {
namespace {

constexpr std::int64_t kLeast = 20'000'000;  // nanoseconds
constexpr double kCrowded = 0.25;            // of the time that the threads ran

}  // namespace

ProcessorWaits::ProcessorWaits(std::filesystem::path tasks) : tasks_(std::move(tasks)), last_(sums()) {}

std::optional<ProcessorWaits::Sums> ProcessorWaits::sums() const {
  Sums sums;
  bool found = false;
  std::error_code failure;
  for (std::filesystem::directory_iterator task(tasks_, failure), end; !failure && task != end;
       task.increment(failure)) {
    std::ifstream file(task->path() / "schedstat");
    std::int64_t ran = 0, waited = 0;
    if (!(file >> ran >> waited)) continue;  // the thread has ended
    found = true;
    sums.ran += ran;
    sums.waited += waited;
  }
  return found ? std::optional(sums) : std::nullopt;
}

bool ProcessorWaits::crowded() {
  const std::optional<Sums> now = sums();
  if (!now || !last_) return false;
  const std::int64_t ran = now->ran - last_->ran, waited = now->waited - last_->waited;
  if (ran < 0 || waited < 0) {
    last_ = now;  // a thread has ended and taken its times with it
  } else if (ran + waited >= kLeast) {
    crowded_ = static_cast<double>(waited) > kCrowded * static_cast<double>(ran);
    last_ = now;
  }
  return crowded_;
}

}  // namespace varimesh::server
