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
  RunMemory(MemoryBudget& budget, std::string owner, const LentThreads& threads, std::function<bool()> given_up)
      : budget_(budget), threads_(threads), given_up_(std::move(given_up)) {
    share_.owner = std::move(owner);
  }
  ~RunMemory() { budget_.give_back(share_, share_.bytes); }
  RunMemory(const RunMemory&) = delete;
  RunMemory& operator=(const RunMemory&) = delete;

  /// Takes the memory for reading a mesh: at least `least`, at most `most`, or all that a job may have. False if the
  /// attempt is to end.
  Expected<bool> take_for_reading(std::int64_t least, std::int64_t most) {
    if (!can_ever_fit(least))
      return bad_input("The mesh takes at least " + mebibytes(least) + " of memory" + of_most() + "or a smaller mesh.");
    return wait(can_ever_fit(most) ? most : budget_.most_of(share_.owner));
  }

  /// Takes the memory for a run, in place of that for reading its mesh. False if the attempt is to end.
  Expected<bool> take(std::int64_t bytes) {
    if (!can_ever_fit(bytes))
      return bad_input("The mesh needs about " + mebibytes(bytes) + " of memory with these options" + of_most() +
                       "a lower order, or the method sweeps.");
    return wait(bytes);
  }

  /// Lends the run memory that no job uses or waits for.
  SpareMemory spare() {
    return {[this](std::int64_t bytes) { return budget_.take_spare(share_, bytes); },
            [this](std::int64_t bytes) { budget_.give_back(share_, bytes); }};
  }

 private:
  bool wait(std::int64_t bytes) {
    bool rests = false;
    const auto given_up = [&] {
      if (!std::exchange(rests, true)) threads_.rest(true);
      return given_up_();
    };
    const bool taken = budget_.exchange(share_, bytes, given_up);
    if (rests) threads_.rest(false);
    return taken;
  }

  bool can_ever_fit(std::int64_t bytes) const { return budget_.can_ever_fit(bytes, share_.owner); }
  /// The middle of a sentence that refuses a mesh.
  std::string of_most() const {
    return std::string(", but ") + (share_.owner.empty() ? "the jobs of this server have" : "a job has") + " only " +
           mebibytes(budget_.most_of(share_.owner)) + (share_.owner.empty() ? " together" : "") +
           " (the server's flag --max-memory-bytes); use a machine with more memory, ";
  }

  static std::string mebibytes(std::int64_t bytes) { return std::to_string((bytes >> 20) + 1) + " MiB"; }

  MemoryBudget& budget_;
  const LentThreads& threads_;
  const std::function<bool()> given_up_;
  MemoryBudget::Share share_;
};

}  // namespace varimesh::server
