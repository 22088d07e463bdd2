// One run on a geometry after another: boundary nodes slide, and the mesh is optimised, within a share of the time that
// is left. Internal to core/optimise.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/optimise/on_geometry/checkpoints_of_runs.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"

namespace varimesh {

/// A limit of time that is over, in seconds. 0 would mean no limit.
inline constexpr double kNoTime = 1e-9;

/// What one run does.
struct RunTask {
  SlideOn slide = SlideOn::None;
  /// The run's share of the time that is left. If it is below 1, another run may follow.
  double share = 1;
  /// The mesh comes from another run, so it is neither snapped nor curved.
  bool is_curved = false;
  /// If all nodes of such a mesh move together and GeometryOptions::tolerance names no length: how far the boundary may
  /// lie from the model, in the mesh's unit of length.
  double most_distance = 0;
};

/// What came of a run.
struct RunOnGeometry {
  Result result;
  /// Nothing if no node was to slide, or if sliding was stopped.
  std::optional<SlidAndMeasured> slid;
  /// Why no node has slid. Then a run that is not the first has no result.
  StopToken::Reason cut_short = StopToken::Reason::None;
  /// Time is short and another run may follow. So this run has left elements without lowering the loss of accuracy, or
  /// it was ended when its share was over.
  bool is_unfinished = false;
};

/// The runs on a geometry, which share a limit of time. Iterations are numbered through.
class RunsOnGeometry {
 public:
  /// What is passed must outlive the object.
  /// @param model  null: nodes slide on the mesh's own boundary
  /// @param watch  runs since the time limit began
  RunsOnGeometry(const GeometryOptions& geometry, const geometry::Geometry* model, const Stopwatch& watch,
                 const OnIteration& on_iteration, const RunControl& control, const OnGeometryHooks& hooks)
      : geometry_(geometry),
        model_(model),
        on_iteration_(on_iteration),
        control_(control),
        hooks_(hooks),
        checkpoints_(control),
        watch_(watch),
        spent_(watch.seconds()) {}

  /// Slides and optimises. In the first run, sentences say what came of sliding, and if sliding is stopped, the mesh is
  /// optimised as it came. Errors: those of slide_on_file() and optimise().
  /// @param options  `time_limit` is for all runs together
  Expected<RunOnGeometry> run(HighOrderMesh mesh, Options options, const RunTask& task);

  /// How much of the time limit is spent, in seconds. Runs that go on from a checkpoint have spent more than has passed
  /// since.
  double spent() const { return std::max(spent_, watch_.seconds()); }
  /// As RunSummary::proof_seconds, of all runs that have ended.
  double proof_seconds() const { return proof_seconds_; }
  int threads_to_slide(const Options& options) const;

 private:
  Expected<void> slide(HighOrderMesh& mesh, const Options& options, const RunTask& task, RunOnGeometry& run) const;
  double left_of_all(const Iteration& own) const;

  const GeometryOptions& geometry_;
  const geometry::Geometry* model_;
  const OnIteration& on_iteration_;
  const RunControl& control_;
  const OnGeometryHooks& hooks_;
  CheckpointsOfRuns checkpoints_;
  bool is_first_ = true;
  int iterations_ = 0;      ///< Of all runs so far,
  const Stopwatch& watch_;  ///< and their seconds:
  double spent_;            ///< those before them, and what they say themselves.
  double proof_seconds_ = 0;
};

/// Tells what came of sliding, without what was told for `before`.
void tell_sentences(const OnGeometryHooks& hooks, const std::optional<SlidAndMeasured>& slid,
                    const std::optional<SlidAndMeasured>& before);
void tell(const OnGeometryHooks& hooks, const std::string& sentence);

}  // namespace varimesh
