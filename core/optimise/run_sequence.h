// Several runs in a sequence that share one limit of iterations and one limit of time.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/optimise/optimiser.h"

namespace varimesh {

/// Runs that a caller sees as one: iterations are numbered through, and the limits are for all of them together. The
/// sequence begins when it is constructed, and `on_iteration` must outlive it.
class RunSequence {
 public:
  RunSequence(const Options& options, const OnIteration& on_iteration, const RunControl& control);

  /// Whether the limits allow another run, and no stop was asked for.
  bool may_go_on() const;

  /// Asks the caller whether to stop. For the time between runs, when no iteration is reported.
  bool stop_asked();

  /// Optimises the mesh with Repair::Report and in its own order, within what is left of the limits. Returns nothing if
  /// the mesh is refused.
  std::optional<Result> run(const HighOrderMesh& mesh);
  /// Like run(), without any iteration: only the reports are made.
  std::optional<Result> judge(const HighOrderMesh& mesh);

  /// Fills in what concerns the whole sequence: history, iterations, seconds and, if a limit or a stop ended it, the
  /// reason. Takes the history; call it once, at the end.
  void finish(Result& result);

 private:
  std::optional<Result> run(const HighOrderMesh& mesh, int max_iterations);

  Options options_;
  const OnIteration& on_iteration_;
  RunControl control_;
  Stopwatch watch_;
  std::vector<Iteration> history_;
  bool stopped_ = false;
};

}  // namespace varimesh
