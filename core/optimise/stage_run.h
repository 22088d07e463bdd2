// One stage of a run, iteration by iteration: which method works next, what is known afterwards, and whether to go on.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/optimise/optimiser.h"
#include "core/optimise/phases.h"
#include "core/ranks/ranks.h"
#include "core/solvers/checkpoint.h"
#include "core/solvers/descent/descent.h"
#include "core/solvers/guard/best_mesh.h"
#include "core/solvers/guard/guard.h"
#include "core/solvers/guard/settling.h"
#include "core/solvers/maxmin/kept_raiser.h"
#include "core/solvers/newton/newton.h"
#include "core/solvers/sweeps/sweep.h"
#include "core/solvers/untangle/untangle.h"

namespace varimesh {

/// What a stage works with. All of it outlives the stage.
struct StageContext {
  const Options& options;
  Problem& problem;
  const ColouredNodes& coloured;
  const Kernels& kernels;
  const HessianKernels* hessian;  ///< Null if the method makes no Newton steps.
  Guard& guard;
  BestMesh& best;
  const Team& team;
  const HighOrderMesh& mesh;
  Untangler::Depth untangling_depth = {};  ///< Layers of cells in the patches of untangling.
  WorkMeter* meter = nullptr;              ///< Counts the work inside iterations; may be null.
  SpareMemory spare_memory = {};           ///< For the Hessians of untangling.
  device::RunDevice* device = nullptr;     ///< For Newton's method; may be null, or without a device.
  const Ranks* ranks = nullptr;            ///< The ranks that share the steps of Newton's method; null: there are none.
};

/// The iterations of one stage. The comments say which functions to call inside team.run(). The result does not depend
/// on the number of threads, which may change between the calls.
class StageRun {
 public:
  /// Inside team.run(). `watch` runs since the whole run began, set-up included.
  StageRun(const StageContext& context, const Stopwatch& watch);

  /// What a stage hands to the next.
  struct Carried {
    std::vector<Iteration> history;
    double first_gradient = 0;  ///< Norm of the energy's gradient in the first iteration of the run.
    Stopwatch watch;
  };
  Carried carry_over() { return {std::move(history_), first_gradient_, watch_}; }
  void follow(Carried carried);

  /// Inside team.run(): examines the mesh as it is. Returns a reason to stop if there is nothing to do.
  std::optional<StopReason> begin();
  /// What follows the state of the stage in a checkpoint.
  using WriteRest = std::function<void(CheckpointWriter&)>;
  using ReadRest = std::function<void(CheckpointReader&)>;
  /// Inside team.run(): goes on after the iteration of the checkpoint. Returns false if the checkpoint cannot be used;
  /// then this stage and its context cannot be used either. `read_rest`: called after the state of the stage was read,
  /// if something follows it.
  bool resume(std::string_view checkpoint, std::uint64_t fingerprint, const ReadRest& read_rest = {});
  /// Inside team.run(): one iteration. Returns a reason to stop if it was the last.
  std::optional<StopReason> step();
  /// After the team's token has interrupted begin() or step(): forgets the iteration that was not finished. No other
  /// function may be called after that, except last() and those that take something out of the stage.
  void forget_unfinished();

  /// Whether a run with Until::Valid would end here without a valid mesh (Stopper::has_just_given_up()).
  bool has_just_given_up() const { return stopper_.has_just_given_up(); }
  /// Call it after the problem's nodes were elsewhere and are back where the last step() has left them.
  void returned();

  /// Whether the state can be written now: the deformation gradients must be those that the positions give.
  bool can_be_kept() const { return exact_; }
  /// Writes the state as a checkpoint; false if the sink stopped.
  bool write(const CheckpointSink& sink, std::uint64_t fingerprint, const WriteRest& write_rest = {});

  /// To be called after every step() of a later stage. `lowest`: the proved minimum of the scaled Jacobian. True if the
  /// stage has raised it as far as it will.
  bool settles(double lowest) { return settling_.after(lowest, iteration_.energy, full_step_); }
  /// Whether the last iteration was a whole Newton step so short that the next stage can go on from there.
  bool is_near_optimum() const;

  /// Frees what the methods keep. No step() may follow.
  void free_methods();
  /// Adds a round of the descent that follows the stage to the history.
  void add(const DescentRound& round);

  const Iteration& last() const { return iteration_; }
  bool converged() const { return converged_; }
  /// Since the run began. With ranks, of the slowest: all call it together.
  double seconds() const { return ranks_ != nullptr ? ranks_->largest(watch_.seconds()) : watch_.seconds(); }
  std::vector<Iteration> take_history() { return std::move(history_); }
  RaiseMemory take_raised() { return raiser_.take_memory(); }

 private:
  /// What every method says about its iteration.
  struct MethodOutcome {
    double gradient = 0;  ///< Norm of the energy's gradient.
    bool stuck = false;   ///< No lower energy was found, or the phase has come to its end.
    bool failed = false;  ///< The residual says nothing.
    bool whole = true;    ///< The residual tells about every free node: a sweep visited all of them, or Newton's method
                          ///< found that all are within the tolerance of the optimum.
  };
  MethodOutcome sweep();
  MethodOutcome newton_step();
  MethodOutcome untangle();
  /// The beginning of untangling. Returns nothing if there is nothing more to raise.
  std::optional<MethodOutcome> raise();
  void certify(MethodOutcome& outcome);
  void record(const MethodOutcome& outcome);
  /// Sets bound_ if it can end the run.
  void prove_bound();
  std::optional<StopReason> reason_to_stop(const MethodOutcome& outcome);
  /// Newton's method gets no further: its linear systems are not solved, or rounding hides what is left to gain.
  std::optional<StopReason> newton_ends();
  Newton& newton();
  /// Frees the arrays of Newton's method while other methods work, which need as much memory. Keeps what the next step
  /// needs, so it is the same step.
  void rest_newton();

  template <class Archive>
  void state(Archive& archive);
  template <class Archive>
  void device_state(Archive& archive);
  template <class Archive>
  void methods_state(Archive& archive);

  const Options& options_;
  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels* hessian_;
  Guard& guard_;
  BestMesh& best_;
  const Team& team_;
  const HighOrderMesh& mesh_;
  Untangler::Depth depth_;
  WorkMeter* meter_;
  const SpareMemory spare_memory_;
  device::RunDevice* const device_;
  const Ranks* const ranks_;
  bool gave_device_up_ = false;      ///< Newton's method had no device in this stage before it rested.
  std::vector<char> device_before_;  ///< What a checkpoint calls the device on which steps were made.
  Stopwatch watch_;
  PNorm norm_;
  Sweeper sweeper_;
  PhaseChooser chooser_;
  Stopper stopper_;
  std::optional<Newton> newton_;     ///< Set up when it is needed.
  std::vector<char> rested_newton_;  ///< The state of a Newton whose arrays were freed; empty: there is none.
  std::optional<Untangler> untangler_;
  Untangler::FailedStarts failed_starts_;
  KeptRaiser raiser_;
  bool raises_ = false;  ///< Untangling has begun, and the next iteration of it goes on to raise.
  Iteration iteration_;
  std::vector<Iteration> history_;
  Settling settling_;
  bool full_step_ = false;  ///< The last iteration was a Newton step that was taken as a whole.
  double first_gradient_ = 0;
  int began_ = 0;     ///< Iterations of the stages before this one.
  double bound_ = 0;  ///< The proved minimum of the scaled Jacobian; only with until_js.
  bool converged_ = false;
  int most_products_ = 0;      ///< Newton steps that reached the largest number of products.
  double least_residual_ = 0;  ///< Of the Newton steps, and
  double least_energy_ = 0;    ///< the lowest energy, when they were last lowered;
  int standing_ = 0;           ///< Newton steps since then.
  bool was_tangled_ = false;   ///< Cells that may be repaired were tangled after the last Newton step.
  bool exact_ = false;         ///< See can_be_kept().
};

}  // namespace varimesh
