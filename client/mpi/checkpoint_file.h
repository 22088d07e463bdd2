// The file in which a run of several processes keeps its state.
#pragma once

#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/base/stopwatch.h"
#include "core/optimise/run_control.h"
#include "core/ranks/ranks.h"

namespace varimesh::client {

/// The first rank writes it, and replaces it as a whole, so the file is always one that a run can go on from. Any
/// number of ranks goes on from it.
class CheckpointFile {
 public:
  /// @param interval  in seconds: so much lies between two checkpoints at least
  CheckpointFile(std::string path, double interval) : path_(std::move(path)), interval_(interval) {}

  /// Reads on all ranks what an earlier run has left; nothing if there is no such file. All call it together. Errors:
  /// BadInput; BadOption if the file is no checkpoint.
  Expected<void> read(const Ranks& ranks);
  std::string_view state() const { return state_; }

  // On the first rank:

  bool is_due() const { return since_last_.seconds() >= interval_; }
  /// Errors: Output. The file is then as it was.
  Expected<void> save(const WriteCheckpoint& write);
  /// Removes the file, because the run has ended by itself.
  void remove() const;

 private:
  std::string path_;
  double interval_;
  std::string state_;
  Stopwatch since_last_;
};

}  // namespace varimesh::client
