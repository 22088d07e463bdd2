// The checkpoints of several runs on one mesh. Each run may begin with other places of the nodes. Internal to
// core/optimise.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/optimise/run_control.h"

namespace varimesh {

/// A checkpoint has the last checkpoint of each finished run, and the last one of the run under way. A caller that goes
/// on from it makes the same runs again: each finished run goes on from its last checkpoint.
class CheckpointsOfRuns {
 public:
  /// `asked` is what the caller asks for; it must outlive the object. A checkpoint that is not of this kind is ignored.
  explicit CheckpointsOfRuns(const RunControl& asked);

  /// The control of the next run.
  /// @param numbered  the run's iteration as the caller sees it
  /// @param is_same   whether the run has the mesh that it had when a checkpoint was made
  RunControl control_of_next(std::function<Iteration(Iteration)> numbered, bool is_same);

 private:
  void read(std::string_view checkpoint);
  bool write(const CheckpointSink& sink, const WriteCheckpoint& write_run);

  const RunControl& asked_;
  std::vector<std::string_view> restored_;  ///< By run; they are parts of asked_.checkpoint.
  std::vector<std::string> last_;           ///< By run; the last one is under way. Empty: it has no checkpoint yet.
};

}  // namespace varimesh
