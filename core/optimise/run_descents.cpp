// The descents of a run to the least loss of accuracy, one from the mesh of another.
#include <algorithm>
#include <utility>

#include "core/optimise/run.h"
#include "core/problem/node_conversion.h"

namespace varimesh {
namespace {

constexpr int kMostDescents = 6;
/// A descent that begins with the weights of the one before is to lower the loss by this share. Otherwise it is the
/// weights that hold it: with nine triangles and two that came tangled, they kept it at .047 in place of .038.
constexpr double kGainWithWeights = 0.1;

}  // namespace

DescentContext Run::descent_context() {
  return {set_up_.mesh,
          set_up_.problem,
          *set_up_.stages[0].kernels,
          *set_up_.stages[0].hessian,
          material(options_),
          *guard_,
          *certifier_,
          team_,
          asked_by(options_),
          came_valid() || descents_ > 0,
          came_valid() && options_.target == Target::StraightSided ? &at_start_ : nullptr,
          {},
          control_.meter,
          control_.device,
          judge_.get()};
}

bool Run::begin_descent() {
  if (descent_) return true;
  team_.run([&] {
    stage_run_->free_methods();
    descent_.emplace(descent_context());
  });
  if (descent_->begin()) return true;
  if (descent_->best().merit.uncertified > 0) result_.notes.emplace_back(Descent::kNotWorthIt);
  return false;
}

void Run::lower_loss() {
  const bool begins = begin_descent();
  if (begins || descent_->has_converged()) result_.stop_reason = StopReason::Converged;
  bool last = !begins;
  do {
    descend(last);
  } while (descends_again(last));
  if (begins && result_.stop_reason == StopReason::Converged && !descent_->has_converged())
    result_.stop_reason = StopReason::NoProgress;
  result_.converged = result_.stop_reason == StopReason::Converged;
  note_last_iteration();
}

void Run::descend(bool last) {
  const auto may_go_on = [&] {
    if (!last && stage_run_->last().number >= options_.max_iterations) result_.stop_reason = StopReason::Iterations;
    return !last && result_.stop_reason == StopReason::Converged;
  };
  const std::uint64_t fingerprint = fingerprint_of_stage();
  if (control_.forecast != nullptr) control_.forecast->descent(stage_run_->seconds());
  while (may_go_on()) {
    if (control_.threads) team_.set_threads(control_.threads());
    const DescentRound round = descent_->round();
    last = round.last;
    stage_run_->add(round);
    forecast(round);
    if (!last && descents_ == 0 && control_.checkpoint_due && control_.checkpoint_due(stage_run_->last()))
      control_.save_checkpoint(stage_run_->last(), [&](const CheckpointSink& sink) {
        return stage_run_->write(sink, fingerprint, [this](CheckpointWriter& writer) { descent_->write(writer); });
      });
    result_.stopped = on_iteration_ && on_iteration_(stage_run_->last()) == Control::Stop;
    show_mesh();
    if (!result_.stopped) continue;
    result_.stop_reason = StopReason::Stopped;
    break;
  }
}

bool Run::is_worth_another_descent() const {
  const bool has_old_targets = !came_valid() && descents_ == 0 && descent_->best().merit.uncertified == 0;
  return options_.target == Target::StraightSided && (descent_->has_gained() || has_old_targets || begins_weighted_) &&
         descents_ + 1 < kMostDescents;
}

void Run::forecast(const DescentRound& round) {
  if (control_.forecast != nullptr)
    control_.forecast->round(round.residual, Descent::kSettled, is_worth_another_descent(), state_for_forecast());
}

bool Run::descends_again(bool& last) {
  if (result_.stop_reason != StopReason::Converged || !is_worth_another_descent()) return false;
  // What low cells have needed is kept, so that it need not be found again. If that leads little further, the next
  // descent begins without it, as another run would: the weight may hold cells that are not low any more.
  retries_ = begins_weighted_ && descent_->gain() < kGainWithWeights;
  most_accurate_ = descent_->take_best();
  std::vector<double> factors = retries_ ? std::vector<double>() : descent_->factors();
  begins_weighted_ = std::ranges::any_of(factors, [](double factor) { return factor > 1; });
  descent_.reset();
  // From here on, an interrupted run has no guard until there is one for the new targets (finish_stages).
  result_.proof_seconds += guard_->seconds();
  guard_.reset();
  std::vector<double> before = std::exchange(set_up_.mesh.coordinates, std::move(most_accurate_.coordinates));
  if (++descents_ == 1) before_descents_ = std::move(before);
  team_.run([&] { set_up_.problem.positions = solver_positions(set_up_.mesh, frame_, team_); });
  choose_targets(set_up_, *certifier_, frame_, team_);
  team_.run([&] {
    guard_.emplace(set_up_.mesh, frame_, set_up_.problem, *certifier_, most_accurate_.certificates, team_);
    DescentContext context = descent_context();
    context.factors = std::move(factors);
    descent_.emplace(context);
  });
  last = !descent_->begin();
  return true;
}

}  // namespace varimesh
