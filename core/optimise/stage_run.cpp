#include "core/optimise/stage_run.h"

#include "core/checkpoint/checkpoint.h"

namespace varimesh {
namespace {

/// Sweeps update the deformation gradients by rank one as nodes move. After this many iterations they are computed
/// again from the positions, so rounding does not add up, and a checkpoint need not hold them.
constexpr int kIterationsBetweenRebuilds = 10;
/// While all cells are valid, only every fourth sweep is followed by certificates.
constexpr int kSettledSweepsBetweenCertificates = 4;
/// The last stages of Objective::Worst are so stiff that steps may go back and forth for long and raise nothing.
constexpr int kMostIterationsOfALaterStage = 30;

template <class Archive>
void iteration_state(Archive& archive, Iteration& i) {
  archive(i.phase, i.number, i.energy, i.residual, i.relative_gradient, i.min_scaled_jacobian, i.invalid_elements,
          i.repairable_elements, i.active_nodes, i.products, i.seconds);
}

}  // namespace

StageRun::StageRun(const StageContext& context, const Stopwatch& watch)
    : options_(context.options),
      problem_(context.problem),
      kernels_(context.kernels),
      hessian_(context.hessian),
      guard_(context.guard),
      best_(context.best),
      team_(context.team),
      watch_(watch),
      norm_{options_.p_norm},
      sweeper_(problem_, context.coloured, kernels_, options_.regularisation, norm_,
               options_.active_set ? options_.tolerance : -1, team_),
      chooser_(options_, guard_.repairable()),
      stopper_(options_) {}

void StageRun::follow(Carried carried) {
  history_ = std::move(carried.history);
  if (!history_.empty()) iteration_ = history_.back();
  first_gradient_ = carried.first_gradient;
  began_ = iteration_.number;
  watch_ = carried.watch;
}

std::optional<StopReason> StageRun::begin() {
  drop_deformation(problem_);  // it belongs to other targets, or to positions that were not accepted
  sweeper_.scan();
  iteration_.invalid_elements = guard_.uncertified();
  iteration_.repairable_elements = guard_.repairable();
  if (options_.until_js > 0) bound_ = best_.consider(guard_, team_.stop());
  return stopper_.after(iteration_, false, chooser_.outlook(guard_.unrepaired()), bound_);
}

std::optional<StopReason> StageRun::step() {
  iteration_.phase = chooser_.phase();
  ++iteration_.number;
  iteration_.products = 0;
  MethodOutcome outcome = iteration_.phase == Phase::Sweeps   ? sweep()
                          : iteration_.phase == Phase::Newton ? newton_step()
                                                              : untangle();
  certify(outcome);
  record(outcome);
  return reason_to_stop(outcome);
}

void StageRun::forget_unfinished() {
  iteration_ = history_.empty() ? Iteration{} : history_.back();
  converged_ = false;
}

// ===== the methods =====

StageRun::MethodOutcome StageRun::sweep() {
  const SweepOutcome swept = sweeper_.sweep();
  exact_ = iteration_.number % kIterationsBetweenRebuilds == 0;
  if (exact_) sweeper_.rebuild();
  iteration_.residual = swept.residual;
  iteration_.active_nodes = swept.visited;
  return {swept.gradient_norm, false, false, swept.visited == static_cast<std::int64_t>(problem_.free.size())};
}

StageRun::MethodOutcome StageRun::newton_step() {
  drop_deformation(problem_);
  const NewtonOutcome stepped = newton().step();
  sweeper_.changed(newton().scans());
  exact_ = true;
  iteration_.residual = stepped.residual;
  iteration_.active_nodes = static_cast<std::int64_t>(problem_.free.size());
  iteration_.products = stepped.products;
  return {stepped.gradient_norm, stepped.damping == 0, stepped.failed, !stepped.cut_short};
}

StageRun::MethodOutcome StageRun::untangle() {
  if (!untangler_) {
    untangler_.emplace(problem_, kernels_, guard_, team_);
    chooser_.untangling_from(guard_.unrepaired());
  }
  const UntangleOutcome untangled = untangler_->step();
  exact_ = true;
  iteration_.residual = untangled.residual;
  iteration_.active_nodes = untangled.active_nodes;
  return {untangled.gradient_norm, false, false, false};
}

Newton& StageRun::newton() {
  if (!newton_) newton_.emplace(problem_, kernels_, *hessian_, norm_, options_.tolerance, team_);
  return *newton_;
}

// ===== after every iteration =====

void StageRun::certify(MethodOutcome& outcome) {
  // Sweeps over cells that are all valid hardly change what is proved. The end certifies all that has moved since.
  const bool settled = iteration_.phase == Phase::Sweeps && guard_.uncertified() == 0 && options_.until_js <= 0;
  if (!settled || iteration_.number % kSettledSweepsBetweenCertificates == 0) guard_.certify_moved();
  if (!untangler_) return;
  untangler_->judge();
  sweeper_.changed();
  outcome.stuck = untangler_->done();
  if (outcome.stuck) untangler_.reset();
}

void StageRun::record(const MethodOutcome& outcome) {
  const ScanOutcome seen = sweeper_.scan();
  if (iteration_.number == 1) first_gradient_ = outcome.gradient;
  iteration_.energy = seen.energy;
  iteration_.relative_gradient = first_gradient_ > 0 ? outcome.gradient / first_gradient_ : 0;
  iteration_.min_scaled_jacobian = seen.min_scaled_jacobian;
  iteration_.invalid_elements = guard_.uncertified();
  iteration_.repairable_elements = guard_.repairable();
  iteration_.seconds = seconds();
  if (options_.until_js > 0) bound_ = best_.consider(guard_, team_.stop());
  history_.push_back(iteration_);
}

std::optional<StopReason> StageRun::reason_to_stop(const MethodOutcome& outcome) {
  const bool small = !outcome.failed && iteration_.residual <= options_.tolerance;
  // That the awake nodes hardly move proves nothing: all nodes must be visited.
  if (small && !outcome.whole) sweeper_.wake();
  converged_ = small && outcome.whole;
  const Outlook outlook = chooser_.outlook(guard_.unrepaired());
  if (const auto reason = stopper_.after(iteration_, converged_, outlook, bound_)) return reason;
  if (began_ > 0 && iteration_.number - began_ >= kMostIterationsOfALaterStage) return StopReason::NoProgress;
  // A small step that was cut short does not end the run. But if something is tangled, it is time for another method.
  const bool idle = small && guard_.unrepaired() > 0 && iteration_.phase == Phase::Newton;
  if (!chooser_.next(guard_.repairable(), guard_.unrepaired(), outcome.stuck || converged_ || idle))
    return StopReason::NoProgress;
  return std::nullopt;
}

// ===== checkpoints =====

template <class Archive>
void StageRun::state(Archive& archive) {
  std::vector<double> positions = free_positions(problem_, problem_.positions);
  archive(positions);
  if constexpr (Archive::kReads)
    if (!set_free_positions(problem_, positions, problem_.positions)) return archive.fail();
  guard_.state(archive);
  sweeper_.state(archive);
  if constexpr (Archive::kReads)
    if (archive.failed() || !sweeper_.refresh()) return archive.fail();
  chooser_.state(archive);
  stopper_.state(archive);
  best_.state(archive);
  std::uint64_t iterations = history_.size();
  archive(first_gradient_, began_, bound_, converged_, iterations);
  for (std::uint64_t i = 0; i < iterations; ++i) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      history_.emplace_back();
    }
    iteration_state(archive, history_[i]);
  }
  methods_state(archive);
}

template <class Archive>
void StageRun::methods_state(Archive& archive) {
  bool with_newton = newton_.has_value(), with_untangler = untangler_.has_value();
  archive(with_newton, with_untangler);
  if constexpr (Archive::kReads) {
    if (archive.failed() || (with_newton && hessian_ == nullptr)) return archive.fail();
    if (with_newton) newton();
    if (with_untangler) {
      sweeper_.rebuild();
      untangler_.emplace(Untangler::ToBeRead{}, problem_, kernels_, guard_, team_);
    }
  }
  if (with_newton) newton_->state(archive);
  if (with_untangler) untangler_->state(archive);
}

bool StageRun::resume(std::string_view checkpoint, std::uint64_t fingerprint) {
  CheckpointReader reader(checkpoint, fingerprint);
  if (!reader.failed()) state(reader);
  if (reader.failed() || history_.empty()) return false;
  iteration_ = history_.back();
  exact_ = true;
  watch_ = Stopwatch::started(iteration_.seconds);
  return true;
}

bool StageRun::write(const CheckpointSink& sink, std::uint64_t fingerprint) {
  CheckpointWriter writer(sink, fingerprint);
  state(writer);
  return writer.finish();
}

}  // namespace varimesh
