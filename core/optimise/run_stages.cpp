// The stages of a run, one after another: a single one for Objective::Energy, several for Objective::Worst.
#include <algorithm>
#include <utility>

#include "core/diagnosis/diagnosis.h"
#include "core/merit/thresholds.h"
#include "core/optimise/memory.h"
#include "core/optimise/run.h"
#include "core/problem/node_conversion.h"
#include "core/problem/targets.h"
#include "core/quality/certified_quality.h"
#include "core/solvers/checkpoint.h"
#include "core/solvers/untangle/untangle.h"

namespace varimesh {

void Run::run_stages() {
  team_.run([&] { frame_ = frame_of(set_up_.mesh, team_.without_stop()); });
  try {
    iterate_stages();
  } catch (const Interrupted&) {
    note_interruption();
  }
  finish_stages();
}

void Run::iterate_stages() {
  std::optional<StopReason> nothing_to_do;
  if (control_.checkpoint.empty() || !resume()) nothing_to_do = begin();
  result_.resumed_from = stage_run_->last().number;
  if (nothing_to_do)
    result_.stop_reason = *nothing_to_do;
  else if (!descent_)
    iterate();
  if (is_for_accuracy()) {
    if (descent_ || can_lower_loss()) lower_loss();
    return;
  }
  const std::size_t stages = set_up_.stages.size();
  if (stages == 1 || (stage_ == 0 && !has_minimum_to_raise())) return;
  while (!nothing_to_do && ended_by_itself(result_.stop_reason) && ++stage_ < stages) {
    nothing_to_do = begin_next_stage();
    if (!nothing_to_do) iterate();
  }
}

// ===== beginning a stage =====

void Run::place_problem() {
  team_.run([&] { set_up_.problem.positions = solver_positions(set_up_.mesh, frame_, team_); });
  result_.substitute_targets = choose_targets(set_up_, *certifier_, frame_, team_);
}

void Run::set_up_stage() {
  guard_.emplace(set_up_.mesh, frame_, set_up_.problem, *certifier_, certificates_, team_, sharers());
  if (options_.repair != Repair::None) guard_->set_unrepairable(result_.unrepairable);
  best_.emplace(*certifier_);
  stage_run_.emplace(context(), watch_);
}

constexpr Untangler::Depth kOneLayer{1, 1, 1};  ///< The patches of RunControl::shallow_untangling.
constexpr Untangler::Depth kShallow{1, 2, 2};   ///< The patches around cells that lost their certificate.

StageContext Run::context() {
  const Stage& stage = set_up_.stages[stage_];
  return {stage.options,
          set_up_.problem,
          set_up_.coloured,
          *stage.kernels,
          stage.hessian.get(),
          *guard_,
          *best_,
          team_,
          set_up_.mesh,
          control_.shallow_untangling ? kOneLayer : Untangler::Depth(),
          control_.meter,
          control_.spare_memory,
          control_.device,
          control_.ranks};
}

std::optional<StopReason> Run::begin() {
  place_problem();
  grace_.watch();
  team_.look_together();
  std::optional<StopReason> nothing_to_do;
  team_.run([&] {
    set_up_stage();
    nothing_to_do = stage_run_->begin();
  });
  return nothing_to_do;
}

/// Finds the stage that the checkpoint is from: its fingerprint fits no other.
bool Run::resume() {
  place_problem();
  for (stage_ = 0; stage_ < set_up_.stages.size(); ++stage_) {
    bool usable = false;
    team_.run([&] {
      set_up_.problem.positions = solver_positions(set_up_.mesh, frame_, team_);  // an attempt at reading spoils them
      if (stage_ > 0) level_targets(set_up_.problem);
      set_up_stage();
      usable = stage_run_->resume(control_.checkpoint, fingerprint_of_stage(), [this](CheckpointReader& reader) {
        Descent::read(descent_, descent_context(), reader);
      });
    });
    if (!usable) continue;
    if (options_.time_limit > 0) grace_.stop_after(options_.time_limit - stage_run_->last().seconds);
    grace_.watch();
    return true;
  }
  control_.checkpoint = {};
  stage_ = 0;
  descent_.reset();
  stage_run_.reset();
  best_.reset();
  guard_.reset();
  return false;
}

std::optional<StopReason> Run::begin_next_stage() {
  level_targets(set_up_.problem);
  std::optional<StopReason> nothing_to_do;
  team_.run([&] {
    StageRun::Carried carried = stage_run_->carry_over();
    stage_run_.emplace(context(), watch_);
    stage_run_->follow(std::move(carried));
    nothing_to_do = stage_run_->begin();
  });
  return nothing_to_do;
}

// ===== iterating, and what comes after =====

void Run::iterate() {
  const std::uint64_t fingerprint = fingerprint_of_stage();
  if (control_.forecast != nullptr) control_.forecast->begin(stage_run_->seconds());
  bool stopped = false;
  std::optional<StopReason> reason;
  while (!stopped && !reason) {
    team_.look_together();
    if (control_.threads) team_.set_threads(control_.threads());
    team_.run([&] { reason = stage_run_->step(); });
    if (stage_ > 0 && raised_enough() && !reason) reason = StopReason::NoProgress;
    if (stage_run_->has_just_given_up() && (!reason || *reason == StopReason::Iterations))
      team_.run([&] { try_to_end_here(); });
    const Iteration& last = stage_run_->last();
    forecast(last);
    if (!reason && control_.checkpoint_due && stage_run_->can_be_kept() && control_.checkpoint_due(last))
      control_.save_checkpoint(last, [&](const CheckpointSink& sink) { return stage_run_->write(sink, fingerprint); });
    stopped = on_iteration_ && on_iteration_(last) == Control::Stop;
    show_mesh();
  }
  note_last_iteration();
  result_.converged = stage_run_->converged();
  result_.stopped = stopped;
  result_.stop_reason = stopped ? StopReason::Stopped : *reason;
}

void Run::forecast(const Iteration& last) {
  if (control_.forecast == nullptr) return;
  const auto method = last.phase == Phase::Sweeps   ? Forecast::Method::Sweep
                      : last.phase == Phase::Newton ? Forecast::Method::Newton
                                                    : Forecast::Method::Untangle;
  control_.forecast->step(method, last.residual, state_for_forecast());
}

void Run::forecast(const DescentRound& round) {
  if (control_.forecast != nullptr)
    control_.forecast->round(round.residual, Descent::kSettled, is_worth_another_descent(), state_for_forecast());
}

Forecast::State Run::state_for_forecast() const {
  Forecast::State state{.now = stage_run_->last().seconds, .is_valid = guard_->uncertified() == 0};
  if (state.is_valid || !set_up_.may_try_other_ways) return state;
  const std::vector<Certificate>& certificates = guard_->latest_certificates();
  const std::vector<char> hopeless = cells_beyond_repair(result_.unrepairable, certificates.size());
  for (std::size_t cell = 0; cell < certificates.size() && !state.hopes; ++cell)
    state.hopes = !certificates[cell].is_valid() && hopeless[cell] == 0;
  return state;
}

/// Does what the end of a run with Until::Valid would do here, and keeps the outcome. The iterations go on as they
/// were.
void Run::try_to_end_here() {
  if (guard_->lost() == 0) return;
  const std::vector<double> positions = set_up_.problem.positions;
  untangle_lost();
  guard_->restore_lost();
  set_up_.problem.positions = positions;
  guard_->certify_moved();
  stage_run_->returned();
}

/// Considers the mesh after an iteration of a later stage for the best one, unless its mean has fallen too far. Returns
/// the proved minimum.
double Run::consider() {
  double bound = 0;
  team_.run([&] {
    guard_->certify_moved();
    bound = best_->examine(*guard_, threshold::kGapOfWorst, team_);
  });
  if (best_->examined_is_better() &&
      scaled_jacobians(set_up_.mesh, best_->examined(), team_, samples()).mean >= best_->least_mean)
    best_->keep_examined();
  return bound;
}

/// Called after each iteration of a later stage: whether another iteration would raise the minimum no further.
bool Run::raised_enough() {
  const bool settled = stage_run_->settles(consider());
  return settled || (stage_ + 1 < set_up_.stages.size() && stage_run_->is_near_optimum());
}

/// Called at the end of the first stage. Its mesh is the best so far, unless one of its cells is not certified: then it
/// has no minimum to raise.
bool Run::has_minimum_to_raise() {
  team_.run([&] {
    guard_->certify_moved();
    guard_->restore_lost();
    best_->examine(*guard_, threshold::kGapOfWorst, team_);
  });
  if (!best_->examined_is_valid()) return false;
  best_->least_mean =
      scaled_jacobians(set_up_.mesh, best_->examined(), team_, samples()).mean - threshold::kMeanGivenForWorst;
  best_->keep_examined();
  return true;
}

/// Whether the descent may begin: the energy has done what it can for the validity of cells, and nothing may follow
/// that could do more, neither a split nor another run. Brings the problem to the mesh that a run with Until::Valid
/// would hand out.
bool Run::can_lower_loss() {
  const bool is_done = result_.stop_reason == StopReason::Valid || result_.stop_reason == StopReason::Repaired ||
                       ended_by_itself(result_.stop_reason);
  if (!is_done || options_.until == Until::Valid) return false;
  team_.run([&] {
    guard_->certify_moved();
    if (ended_by_itself(result_.stop_reason)) untangle_lost();
    guard_->return_to_ending();
  });
  if (control_.another_follows && !are_valid(guard_->certificates())) return false;
  return guard_->unrepaired() == 0 || !control_.shallow_untangling;
}

void Run::note_last_iteration() {
  result_.iterations = stage_run_->last().number;
  result_.residual = stage_run_->last().residual;
}

void Run::note_interruption() {
  grace_.begin();
  grace_.say_stopped(result_);
  if (!stage_run_) return;
  stage_run_->forget_unfinished();
  note_last_iteration();
}

void Run::finish_stages() {
  if (stage_run_) {
    result_.seconds = stage_run_->seconds();
    result_.history = stage_run_->take_history();
    raised_ = stage_run_->take_raised();
    const bool in_vain = retries_ && descent_ && !descent_->has_gained();
    if (descent_ && !descent_->best().coordinates.empty() && !in_vain)
      most_accurate_ = descent_->take_best();
    else if (descents_ > 0)  // the last descent gained nothing, or was interrupted before it had a mesh
      most_accurate_.coordinates = set_up_.mesh.coordinates;
    descent_.reset();
    stage_run_.reset();  // frees what Newton's method needed
    drop_deformation(set_up_.problem);
    const Stopwatch watch;
    if (guard_)
      settle_and_take_mesh();
    else  // interrupted between two descents
      take_most_accurate();
    if (descents_ > 0) set_up_.mesh.coordinates = std::move(before_descents_);
    result_.seconds += watch.seconds();
  } else {  // interrupted before the first stage: the mesh as it came, with the certificates that it has
    result_.mesh.coordinates = set_up_.mesh.coordinates;
    result_.seconds = watch_.seconds();
  }
  best_.reset();
  guard_.reset();
}

void Run::untangle_from_here() {
  Untangler::FailedStarts failed_starts;  // other cells than those that untangling has given up before
  // Deeper patches around 19 such cells take in most of a published mesh: over a minute in place of 4 s.
  Untangler untangler(Untangler::FromHere{}, set_up_.problem, *set_up_.stages[0].kernels, *guard_, team_, failed_starts,
                      control_.shallow_untangling ? kOneLayer : kShallow, room_for_hessians(set_up_.mesh, options_),
                      control_.spare_memory);
  while (!untangler.done()) {
    untangler.step();
    guard_->certify_moved();
    untangler.judge();
  }
}

/// Makes the cells valid that lost their certificate on the way, with their neighbours. If they only went back to where
/// they had it, those around them would lose theirs, and so on. Returns false, without doing it, if the run is to end.
bool Run::untangle_lost() {
  if (options_.method != Method::Auto || stage_ > 0 || !control_.untangles_lost || guard_->lost() == 0) return true;
  if (grace_.stopped()) return false;
  const std::vector<double> optimum = set_up_.problem.positions;
  drop_deformation(set_up_.problem);
  try {
    if (KeptRaiser(set_up_.mesh, set_up_.problem, *guard_, team_).raise_lost()) guard_->certify_moved();
    if (guard_->lost() > 0) untangle_from_here();
  } catch (const Interrupted&) {
    set_up_.problem.positions = optimum;
    throw;
  }
  drop_deformation(set_up_.problem);
  return true;
}

void Run::settle() {
  team_.run([&] {
    const auto deny_convergence = [&] {
      if (std::exchange(result_.converged, false)) result_.stop_reason = StopReason::NoProgress;
    };
    guard_->certify_moved();
    if (guard_->lost() > 0) deny_convergence();
    if (ended_by_itself(result_.stop_reason) && !untangle_lost()) grace_.say_stopped(result_);
    guard_->restore_lost();
    if (guard_->return_to_best()) deny_convergence();
    if (options_.until_js > 0) best_->consider(*guard_, team_);
  });
}

void Run::settle_and_take_mesh() {
  // The kept state is whole whatever interrupts the guard.
  grace_.finish([&] { settle(); },
                [&] {
                  grace_.say_stopped(result_);
                  team_.run([&] { guard_->return_to_best(); });
                });
  take_mesh();
}

void Run::take_most_accurate() {
  result_.mesh.coordinates = std::move(most_accurate_.coordinates);
  certificates_ = std::move(most_accurate_.certificates);
}

void Run::take_mesh() {
  certificates_ = guard_->certificates();
  Merit at_end;
  team_.run([&] { at_end = merit_of(summarise(certificates_, team_.without_stop())); });
  const bool keeps_best = options_.until_js > 0 || set_up_.stages.size() > 1;
  const bool takes_best = keeps_best && !best_->coordinates().empty() && !is_better(at_end, best_->merit());
  result_.proof_seconds += guard_->seconds();
  if (!most_accurate_.coordinates.empty() && !is_better(at_end, most_accurate_.merit)) return take_most_accurate();
  team_.run([&] { result_.mesh.coordinates = takes_best ? best_->coordinates() : guard_->coordinates(); });
  if (!takes_best) return;
  const auto certify = [&](const Team& team) {
    team.run([&] { certifier_->certify(result_.mesh.coordinates, certificates_, team, sharers()); });
  };
  grace_.finish([&] { certify(team_); },
                [&] {
                  if (best_->certificates().empty())
                    certify(team_.without_stop());  // the best mesh is from a checkpoint
                  else
                    certificates_ = best_->certificates();
                });
}

/// 0 if no checkpoint is read or written.
std::uint64_t Run::fingerprint_of_stage() const {
  if (!control_.checkpoint_due && control_.checkpoint.empty()) return 0;
  return fingerprint(set_up_.mesh, set_up_.fixed, set_up_.target, set_up_.stages[stage_].options);
}

}  // namespace varimesh
