// The memory that the process of a job has borrowed.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/base/spare_memory.h"
#include "server/isolation/worker_process.h"

namespace varimesh::server {

/// Lends a process memory beyond what its run was admitted with, and lets its address space grow by that.
class Loan {
 public:
  /// `run`: the address space of the run before, in bytes.
  void begin(const WorkerProcess& process, std::int64_t run) {
    run_ = run;
    process.limit_memory(run_ + most_);
  }

  /// Returns how much is lent, in bytes. Throws ProcessLost if the process asks for more than a run can have.
  std::int64_t lend(const WorkerProcess& process, const SpareMemory& spare, std::int64_t bytes) {
    if (bytes <= 0 || bytes > kMostSpareMemory - lent_) throw ProcessLost{"asked for too much memory"};
    const std::int64_t lent = spare.take ? spare.take(bytes) : 0;
    lent_ += lent;
    most_ = std::max(most_, lent_);
    process.limit_memory(run_ + most_);
    return lent;
  }

  /// The limit stays, since what the process gives back may stay in its heap.
  void take_back(const SpareMemory& spare, std::int64_t bytes) {
    if (bytes <= 0 || bytes > lent_) throw ProcessLost{"gave back memory that it did not have"};
    lent_ -= bytes;
    spare.give_back(bytes);
  }

 private:
  std::int64_t run_ = 0, lent_ = 0, most_ = 0;
};

}  // namespace varimesh::server
