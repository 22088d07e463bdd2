// A run from mesh to result: certificates, diagnosis, quality before, the stages, straightening, quality after.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/forecast/forecast.h"
#include "core/merit/merit.h"
#include "core/optimise/grace.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/optimise/set_up.h"
#include "core/optimise/stage_run.h"
#include "core/quality/sample_cells.h"
#include "core/solvers/descent/descent.h"
#include "core/solvers/guard/best_mesh.h"
#include "core/solvers/guard/guard.h"
#include "core/solvers/maxmin/raise.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// Everything that a run has, and its steps. Each object is for one run without splits (core/optimise/sequences has
/// several), and what its constructor takes must outlive it. No function may be called inside team.run().
class Run {
 public:
  /// `stop` is the token of the run.
  Run(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop);

  /// Optimises the mesh of the set-up, in which no cell is clockwise, as it is. Call it once.
  Result go();

 private:
  // ===== run.cpp: before and after the stages =====

  /// The quality of the mesh as it came. Afterwards `certificates_` belong to the mesh of the set-up, in which layers
  /// have been brought into form.
  void judge_as_it_came();
  /// The quality of this mesh, which has the elements of the run's, and what its layers are worth.
  QualityReport judge(const HighOrderMesh& mesh);
  /// Certifies the mesh. If a cell is not valid, finds what cannot be repaired; if all are, there is nothing to repair.
  void prove();
  bool came_valid() const { return result_.before.uncertified.empty(); }
  /// Nothing may move, or only nodes that layers hold.
  bool has_no_free_node() const {
    return set_up_.summary.free_nodes == 0 || (!set_up_.stages.empty() && set_up_.problem.free.empty());
  }
  bool is_for_accuracy() const { return options_.objective == Objective::Accuracy; }
  /// All ranks of the run; one without ranks.
  const Ranks& sharers() const { return control_.ranks != nullptr ? *control_.ranks : one_rank(); }
  /// What samples cells in place of this process by itself: all ranks, or a device. Null: this process does it.
  detail::SamplesElsewhere* samples() {
    return of_ranks_ ? static_cast<detail::SamplesElsewhere*>(&*of_ranks_) : judge_.get();
  }
  /// Why nothing was moved, though the run was not stopped; empty if something may have been moved.
  std::string why_unmoved();
  /// If no node may move, the run has converged.
  void note_no_free_node();
  /// Takes the mesh as it came, with the note that says why.
  void take_as_it_came(const std::string& why);
  /// Makes the most of the mesh that the stages have left.
  void finish_mesh();
  /// Raises the smallest scaled Jacobian around cells that the run leaves invalid, except for cells that it has tried
  /// in vain. If no cell is left invalid, and with Objective::Accuracy, it also raises cells below Options::min_js.
  /// That costs accuracy. So it does not do this if the mesh misses the bound in any case, or if a mesh that came in
  /// valid would get a higher loss.
  void raise_low();
  void straighten_result();

  // ===== handed_out.cpp: which mesh is handed out =====

  /// Goes back to the mesh as it came if it was better: if it was valid, or if the run has certified no more cells and
  /// its loss of accuracy is higher. With another target than the straight-sided shape the caller asks for a change,
  /// which the scaled Jacobian does not judge.
  void keep_the_better();
  void keep_as_it_came(std::string why);
  /// If the mesh has a lower loss where the run ended, but a solver's error in its layers may be higher: goes the
  /// largest of three shares of the way there at which the loss is lower and no profile loses anything. False if there
  /// is none; the mesh is then the one where the run ended, and `certificates_` are those of another mesh.
  bool goes_part_of_the_way();

  // ===== run_stages.cpp: a single stage for Objective::Energy, several for Objective::Worst =====

  /// Runs all stages. It sets only the coordinates of the result's mesh; the rest can be copied once their memory has
  /// been freed. Afterwards `certificates_` belong to the result's mesh. If the token stops the run, the result's mesh
  /// is the best mesh so far.
  void run_stages();
  void iterate_stages();
  /// Sets the problem's nodes and targets.
  void place_problem();
  /// Makes a new guard, best mesh and stage. Inside team.run().
  void set_up_stage();
  StageContext context();
  /// Begins at the beginning. Returns a reason to stop if there is nothing to do.
  std::optional<StopReason> begin();
  /// Begins after the iteration of the checkpoint. Returns false, and forgets the checkpoint, if it cannot be used.
  bool resume();
  std::optional<StopReason> begin_next_stage();
  void iterate();
  /// Shows the mesh of the last iteration if somebody wants to see it.
  void show_mesh();
  /// Tells the forecast of an iteration.
  void forecast(const Iteration& last);
  /// Tells the forecast of a round of a descent.
  void forecast(const DescentRound& round);
  Forecast::State state_for_forecast() const;
  bool has_minimum_to_raise();
  void try_to_end_here();
  double consider();
  bool raised_enough();
  bool can_lower_loss();
  /// Sets what the result says about the iterations so far.
  void note_last_iteration();
  /// The token of the run has interrupted a stage, or the beginning of one.
  void note_interruption();
  /// Hands the mesh of the stages over, and frees what they needed.
  void finish_stages();
  bool untangle_lost();
  /// Untangles cells that lost their certificate and that raising has left.
  void untangle_from_here();
  /// Brings the guard's kept state up to date.
  void settle();
  void settle_and_take_mesh();
  /// Takes the mesh of the guard, or the best one that a stage or a descent has kept.
  void take_mesh();
  void take_most_accurate();
  std::uint64_t fingerprint_of_stage() const;

  // ===== run.cpp: the descents of Objective::Accuracy, after the only stage =====

  void lower_loss();
  bool begin_descent();
  DescentContext descent_context();
  /// The rounds of a descent. `last`: there are none.
  void descend(bool last);
  /// Whether another descent, from the mesh that the last descent has made, would be worth it.
  bool is_worth_another_descent() const;
  /// Begins a descent from the mesh that the last descent has made, as another run would: with targets from that mesh.
  /// The first targets may be those of a tangled mesh. Returns false if the last descent has gained next to nothing,
  /// and began without the weights of another. `last`: there is nothing to gain. No checkpoint is taken in these
  /// descents.
  bool descends_again(bool& last);

  SetUp& set_up_;
  const Options& options_;
  const OnIteration& on_iteration_;
  RunControl control_;
  Stopwatch watch_;  ///< Since the run began, set-up included.
  Team team_;
  std::unique_ptr<JudgeOnDevice> judge_;            ///< Null: the run began without a device.
  std::optional<detail::SamplesOfRanks> of_ranks_;  ///< With ranks.
  std::unique_ptr<const Certifier> certifier_;
  std::vector<Certificate> certificates_;  ///< Of the mesh as it came, and after the stages of the result's mesh.
  Grace grace_;
  Result result_;
  /// Of the mesh from which the run begins. With a spacing of layers that the options ask for, no step of the run is
  /// compared with the mesh before.
  QualityReport at_start_;
  RaiseMemory raised_;  ///< What the run tried to raise.

  // While the stages run:
  Frame frame_;
  std::size_t stage_ = 0;
  std::optional<Guard> guard_;
  std::optional<BestMesh> best_;
  std::optional<StageRun> stage_run_;
  std::optional<Descent> descent_;
  int descents_ = 0;              ///< Those before the present one.
  bool begins_weighted_ = false;  ///< The present one began with more weight for low cells than another run would give.
  bool retries_ = false;  ///< The last one began with such weight and gained little; the present one began without.
  std::vector<double> before_descents_;  ///< With descents_ > 0, the coordinates of set_up_.mesh before the first.
  Descent::State most_accurate_;  ///< Of the descents so far; while another runs, set_up_.mesh has its coordinates.
};

/// Whether a limit or the caller has ended the run.
bool was_cut_short(const RunSummary& result);

}  // namespace varimesh
