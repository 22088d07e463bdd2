// The memory that one attempt at a job holds.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/spare_memory.h"
#include "server/resources/memory_budget.h"
#include "server/resources/thread_shares.h"

namespace varimesh::server {

/// The memory of a run. While the run waits for memory, other jobs have its threads.
class RunMemory {
 public:
  RunMemory(MemoryBudget& budget, const LentThreads& threads, std::function<bool()> given_up)
      : budget_(budget), threads_(threads), given_up_(std::move(given_up)) {}
  ~RunMemory() {
    if (taken_ > 0) budget_.give_back(taken_);
  }

  /// Takes the memory for reading a mesh: at least `least`, at most `most`, or all that there is. False if the attempt
  /// is to end.
  Expected<bool> take_for_reading(std::int64_t least, std::int64_t most) {
    if (!budget_.can_ever_fit(least))
      return bad_input("The mesh takes at least " + mebibytes(least) +
                       " of memory, but the jobs of this server have only " + mebibytes(budget_.limit()) +
                       " together (its flag --max-memory-bytes); use a machine with more memory, or a smaller mesh.");
    return wait(budget_.can_ever_fit(most) ? most : budget_.limit());
  }

  /// Takes the memory for a run, in place of that for reading its mesh. False if the attempt is to end.
  Expected<bool> take(std::int64_t bytes) {
    if (!budget_.can_ever_fit(bytes))
      return bad_input("The mesh needs about " + mebibytes(bytes) +
                       " of memory with these options, but the jobs of this server have only " +
                       mebibytes(budget_.limit()) +
                       " together (its flag --max-memory-bytes); use a machine with more memory, a lower order, or "
                       "the method sweeps.");
    return wait(bytes);
  }

  /// Lends the run memory that no job uses or waits for.
  SpareMemory spare() {
    return {[this](std::int64_t bytes) {
              const std::int64_t lent = budget_.take_spare(bytes);
              taken_ += lent;
              return lent;
            },
            [this](std::int64_t bytes) {
              budget_.give_back(bytes);
              taken_ -= bytes;
            }};
  }

 private:
  bool wait(std::int64_t bytes) {
    bool rests = false;
    const auto given_up = [&] {
      if (!std::exchange(rests, true)) threads_.rest(true);
      return given_up_();
    };
    const bool taken = taken_ > 0 ? budget_.exchange(taken_, bytes, given_up) : budget_.take(bytes, given_up);
    if (rests) threads_.rest(false);
    if (taken) taken_ = bytes;
    return taken;
  }

  static std::string mebibytes(std::int64_t bytes) { return std::to_string((bytes >> 20) + 1) + " MiB"; }

  MemoryBudget& budget_;
  const LentThreads& threads_;
  const std::function<bool()> given_up_;
  std::int64_t taken_ = 0;
};

}  // namespace varimesh::server
