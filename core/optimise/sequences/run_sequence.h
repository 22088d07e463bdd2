// Several runs that a caller sees as one. Internal to core/optimise.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/stop_token.h"
#include "core/base/stopwatch.h"
#include "core/optimise/optimiser.h"
#include "core/solvers/checkpoint.h"

namespace varimesh {

/// The control of each run of a sequence with this control: the same, except that the sequence makes the checkpoints,
/// and that patches have one layer.
RunControl control_of_each_run(const RunControl& asked);

/// Runs that a caller sees as one: iterations are numbered through, and the limits are for all of them together. The
/// sequence begins when it is constructed, and what its constructor takes must outlive it.
///
/// A checkpoint has the results of the runs that are finished, and the checkpoint of the one that is under way. A
/// sequence that goes on from it is given the same meshes again. It takes the results that were kept until it comes to
/// the run that was under way, and this goes on. Until then no limit and no stop ends it, because none did.
class RunSequence {
 public:
  /// `fingerprint` is that of the mesh and the options; only for checkpoints.
  RunSequence(const Options& options, std::uint64_t fingerprint, const OnIteration& on_iteration,
              const RunControl& control, StopToken& stop);

  /// Rounds begin. They may do at most this much more work; the iteration that passes it is the last. Cells that lose
  /// their certificate in a round are not untangled: a split beside them may be next.
  void begin_rounds(double work);
  /// Rounds are over. What follows may do at most this much more work.
  void end_rounds(double work);
  /// The work so far.
  double work() const { return work_; }

  /// A look for splits has found this many groups.
  void note_groups(std::int64_t groups);

  /// Whether the limits allow another run, and no stop was asked for.
  bool may_go_on() const;
  /// Whether the caller or the token has stopped the sequence.
  bool stopped() const { return !restores_ && (stopped_ || stop_.stopped()); }
  /// What stops the work between the runs.
  StopToken& token() { return restores_ ? never_ : stop_; }
  /// Whether the work that was allowed is done.
  bool out_of_work() const { return work_ >= most_work_; }

  /// As run(), but without untangling and with few iterations: untangling takes most of the time if a split is needed.
  std::optional<Result> run_briefly(const HighOrderMesh& mesh);
  /// Optimises the mesh with Repair::Report and in its own order, within what is left of the limits. Returns nothing if
  /// the mesh is refused.
  std::optional<Result> run(const HighOrderMesh& mesh);

  /// Fills in what concerns the whole sequence: history, iterations, seconds and, if a limit or a stop ended it, the
  /// reason. Takes the history; call it once, at the end.
  void finish(Result& result);

 private:
  /// What a checkpoint has beside that of the run under way.
  struct Kept {
    std::vector<std::vector<char>> finished;  ///< Results (kept_result.h).
    double begun = 0;                         ///< Seconds of the sequence when the run under way began.
    double seconds = 0;                       ///< And at the checkpoint.
    double work = 0;                          ///< At the checkpoint.
    template <class Archive>
    void state(Archive& archive);
  };

  bool read(std::string_view checkpoint);
  bool write(const CheckpointSink& sink, const WriteCheckpoint& write_run);
  /// If the next run is finished in the checkpoint: takes its result.
  bool take_finished(const HighOrderMesh& mesh, std::optional<Result>& result);
  std::optional<Result> run_anew(const HighOrderMesh& mesh);
  /// The iteration of the run under way, as the caller sees it.
  Iteration numbered_through(Iteration iteration) const;
  RunControl control_of_run();
  /// Notes that a run is finished.
  void add(std::optional<Result>& result);

  Options options_;
  const std::uint64_t fingerprint_;
  const OnIteration& on_iteration_;
  const RunControl& asked_;  ///< What the caller asks for.
  StopToken& stop_;
  StopToken never_;
  RunControl control_;
  Stopwatch watch_;
  std::vector<Iteration> history_;  ///< Of the finished runs.
  double begun_ = 0;                ///< Seconds when the run under way began.
  double work_ = 0, most_work_ = std::numeric_limits<double>::infinity();
  std::int64_t groups_left_ = -1, looks_ = 0;
  bool stopped_ = false;
  std::size_t finished_runs_ = 0;
  Kept kept_;                   ///< Without results if there are no checkpoints.
  bool restores_ = false;       ///< The run that goes on from a checkpoint has not begun.
  Kept restored_;               ///< What the checkpoint had,
  std::string_view under_way_;  ///< and the checkpoint of the run that was under way.
  int resumed_from_ = 0;
};

}  // namespace varimesh
