#include "core/optimise/stage_run.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/optimise/iteration_state.h"
#include "core/optimise/memory.h"
#include "core/solvers/checkpoint.h"

namespace varimesh {
namespace {

/// Sweeps update the deformation gradients by rank one as nodes move. After this many iterations they are computed
/// again from the positions, so rounding does not add up, and a checkpoint need not hold them.
constexpr int kIterationsBetweenRebuilds = 10;
/// While all cells are valid, only every fourth sweep is followed by certificates.
constexpr int kSettledSweepsBetweenCertificates = 4;
/// The last stages of Objective::Worst are so stiff that steps may go back and forth for long and raise nothing.
constexpr int kMostIterationsOfALaterStage = 30;
/// Conjugate gradients spend most products of a later stage on displacements that hardly change J. These products raise
/// no minimum: on 10,000 triangles of order 5, one step of 417 products left it at .9965.
constexpr int kMostProductsOfALaterStage = 60;
/// A later stage other than the last has done its work after a whole Newton step that is not longer than this, in units
/// of the cells' size. With any whole step the boundary layer of an aerofoil ended at .644, with this one at .765.
constexpr double kNearOptimum = 0.05;
/// A step with the largest number of products costs as much as a whole run on a usual mesh. A few of them on the way
/// happen with a large λ.
constexpr int kMostWithMostProducts = 10;
/// Newton steps without a lower energy or residual. Far from the optimum the energy falls in every step.
constexpr int kMostStanding = 10;
constexpr double kLowerResidual = 0.5;  // times the least one
constexpr double kLowerEnergy = 1e-12;  // of the energy; its rounding is less
/// kMostStanding and kLowerEnergy while cells are tangled. δ depends on the mesh, so the energy also rises from one
/// step to the next, and two meshes with two δ may follow each other without an end, at energies that differ by 1e-8
/// from one round to the next.
constexpr int kMostStandingTangled = 50;
constexpr double kLowerEnergyTangled = 1e-6;

}  // namespace

StageRun::StageRun(const StageContext& context, const Stopwatch& watch)
    : options_(context.options),
      problem_(context.problem),
      kernels_(context.kernels),
      hessian_(context.hessian),
      guard_(context.guard),
      best_(context.best),
      team_(context.team),
      mesh_(context.mesh),
      depth_(context.untangling_depth),
      meter_(context.meter),
      spare_memory_(context.spare_memory),
      device_(context.device),
      ranks_(context.ranks),
      watch_(watch),
      norm_{options_.p_norm},
      sweeper_(problem_, context.coloured, kernels_, options_.regularisation, norm_,
               options_.active_set ? options_.tolerance : -1, team_),
      chooser_(options_, guard_.repairable()),
      stopper_(options_),
      raiser_(mesh_, problem_, guard_, team_) {
  sweeper_.count_with(meter_, point_operations(material(options_), problem_.dimension));
}

void StageRun::follow(Carried carried) {
  history_ = std::move(carried.history);
  if (!history_.empty()) iteration_ = history_.back();
  first_gradient_ = carried.first_gradient;
  began_ = iteration_.number;
  watch_ = carried.watch;
}

std::optional<StopReason> StageRun::begin() {
  drop_deformation(problem_);  // it belongs to other targets, or to positions that were not accepted
  iteration_.min_scaled_jacobian = sweeper_.scan().min_scaled_jacobian;
  iteration_.invalid_elements = guard_.uncertified();
  iteration_.repairable_elements = guard_.repairable();
  iteration_.left_elements = guard_.fewest();
  prove_bound();
  return stopper_.after(iteration_, false, chooser_.outlook(guard_.unrepaired()), bound_);
}

std::optional<StopReason> StageRun::step() {
  iteration_.phase = chooser_.phase();
  ++iteration_.number;
  iteration_.products = 0;
  iteration_.linear_solve = LinearSolve::None;
  iteration_.on_device = false;
  full_step_ = false;
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
  rest_newton();
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
  iteration_.linear_solve = stepped.linear_solve;
  iteration_.on_device = newton().is_on_device();
  full_step_ = stepped.damping == 1 && stepped.linear_solve != LinearSolve::NegativeCurvature;
  return {stepped.gradient_norm, stepped.damping == 0, stepped.failed, stepped.converged};
}

StageRun::MethodOutcome StageRun::untangle() {
  if (!untangler_) {
    if (!raises_) {
      rest_newton();
      chooser_.untangling_from(guard_.unrepaired());
      raises_ = true;
    }
    if (const std::optional<MethodOutcome> raised = raise()) return *raised;
    raises_ = false;
    untangler_.emplace(problem_, kernels_, guard_, team_, failed_starts_, depth_, room_for_hessians(mesh_, options_),
                       spare_memory_);
  }
  const UntangleOutcome untangled = untangler_->step();
  exact_ = true;
  iteration_.residual = untangled.residual;
  iteration_.active_nodes = untangled.active_nodes;
  return {untangled.gradient_norm, false, false, false};
}

std::optional<StageRun::MethodOutcome> StageRun::raise() {
  drop_deformation(problem_);
  const KeptRaiser::Outcome raised = raiser_.step();
  if (!raised.tried && raised.finished) return std::nullopt;
  exact_ = true;
  iteration_.residual = raised.residual;
  iteration_.active_nodes = raised.active_nodes;
  return MethodOutcome{0, false, false, false};
}

Newton& StageRun::newton() {
  if (newton_) return *newton_;
  if (ranks_ != nullptr)
    newton_.emplace(problem_, kernels_, *hessian_, norm_, options_.tolerance, team_, *ranks_);
  else if (device_ != nullptr && !gave_device_up_)
    newton_.emplace(problem_, kernels_, *hessian_, norm_, options_.tolerance, team_, *device_, material(options_));
  else
    newton_.emplace(problem_, kernels_, *hessian_, norm_, options_.tolerance, team_);
  newton_->count_with(meter_, point_operations(material(options_), problem_.dimension));
  if (began_ > 0) newton_->solve_roughly(kMostProductsOfALaterStage);
  if (!rested_newton_.empty()) {
    CheckpointReader reader({rested_newton_.data(), rested_newton_.size()}, 0);
    newton_->state(reader);
    assert(!reader.failed());
    std::vector<char>().swap(rested_newton_);
  }
  return *newton_;
}

void StageRun::rest_newton() {
  if (!newton_) return;
  CheckpointWriter writer(
      [&](std::string_view bytes) {
        rested_newton_.insert(rested_newton_.end(), bytes.begin(), bytes.end());
        return true;
      },
      0);
  newton_->state(writer);
  writer.finish();
  gave_device_up_ = !newton_->is_on_device();
  newton_.reset();
}

// ===== after every iteration =====

void StageRun::certify(MethodOutcome& outcome) {
  // Sweeps over cells that are all valid hardly change what is proved. The end certifies all that has moved since.
  const bool settled = iteration_.phase == Phase::Sweeps && guard_.uncertified() == 0 && options_.until_js <= 0;
  if (!settled || iteration_.number % kSettledSweepsBetweenCertificates == 0) guard_.certify_moved();
  if (raises_) {
    sweeper_.changed();
    outcome.stuck = guard_.unrepaired() == 0;
    raises_ = !outcome.stuck;
  }
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
  iteration_.left_elements = guard_.fewest();
  iteration_.seconds = seconds();
  prove_bound();
  history_.push_back(iteration_);
}

void StageRun::prove_bound() {
  if (options_.until_js > 0)
    bound_ = best_.consider(guard_, team_);
  else if (stopper_.asks_for_proof(iteration_))
    bound_ = best_.examine(guard_, Certifier::kMinimumGap, team_);
}

std::optional<StopReason> StageRun::reason_to_stop(const MethodOutcome& outcome) {
  const bool small = !outcome.failed && iteration_.residual <= options_.tolerance;
  // That the awake nodes hardly move proves nothing: all nodes must be visited.
  if (small && !outcome.whole) sweeper_.wake();
  // The steps of single nodes say little about the optimum (docs/method.md). If Newton's method may follow, it decides.
  const bool may_end = iteration_.phase == Phase::Newton || options_.method == Method::Sweeps;
  converged_ = small && outcome.whole && may_end;
  const Outlook outlook = chooser_.outlook(guard_.unrepaired());
  if (const auto reason = stopper_.after(iteration_, converged_, outlook, bound_)) return reason;
  if (iteration_.phase != Phase::Newton)
    least_residual_ = 0;
  else if (const auto reason = newton_ends())
    return reason;
  if (began_ > 0 && iteration_.number - began_ >= kMostIterationsOfALaterStage) return StopReason::NoProgress;
  // A small step that proves nothing does not end the run. But if something is tangled, it is time for another method.
  const bool idle = small && guard_.unrepaired() > 0 && iteration_.phase == Phase::Newton;
  if (!chooser_.next(guard_.repairable(), guard_.unrepaired(), outcome.stuck || (small && outcome.whole) || idle))
    return StopReason::NoProgress;
  return std::nullopt;
}

std::optional<StopReason> StageRun::newton_ends() {
  if (began_ == 0 && iteration_.linear_solve == LinearSolve::MostProducts && ++most_products_ >= kMostWithMostProducts)
    return StopReason::MostProducts;
  const bool tangled = guard_.unrepaired() > 0;
  const bool has_fewer = history_.size() > 1 && history_[history_.size() - 2].left_elements > iteration_.left_elements;
  const bool first = least_residual_ == 0 || has_fewer || tangled != std::exchange(was_tangled_, tangled);
  const double lower = tangled ? kLowerEnergyTangled : kLowerEnergy;
  if (first || iteration_.residual < kLowerResidual * least_residual_ ||
      iteration_.energy < least_energy_ - lower * std::abs(least_energy_)) {
    least_residual_ = first ? iteration_.residual : std::min(least_residual_, iteration_.residual);
    least_energy_ = first ? iteration_.energy : std::min(least_energy_, iteration_.energy);
    standing_ = 0;
    return std::nullopt;
  }
  // Other methods may come for tangled cells, and decide when to go on.
  const bool waits = tangled && chooser_.outlook(guard_.unrepaired()) != Outlook::Nothing;
  const int most = tangled ? kMostStandingTangled : kMostStanding;
  return ++standing_ < most || waits ? std::nullopt : std::optional(StopReason::NoProgress);
}

void StageRun::returned() {
  drop_deformation(problem_);
  sweeper_.changed();
  exact_ = true;
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
  settling_.state(archive);
  std::uint64_t iterations = history_.size();
  archive(first_gradient_, began_, bound_, converged_, most_products_, least_residual_, least_energy_, standing_,
          was_tangled_, iterations);
  for (std::uint64_t i = 0; i < iterations; ++i) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      history_.emplace_back();
    }
    iteration_state(archive, history_[i]);
  }
  device_state(archive);
  methods_state(archive);
}

/// The name of the device on which steps were made. The run that goes on may have another device, or none.
template <class Archive>
void StageRun::device_state(Archive& archive) {
  if constexpr (!Archive::kReads) {
    const std::string name = device_ == nullptr ? "" : device_->done_on();
    device_before_.assign(name.begin(), name.end());
  }
  archive(device_before_);
}

template <class Archive>
void StageRun::methods_state(Archive& archive) {
  bool with_newton = newton_.has_value(), with_untangler = untangler_.has_value();
  archive(with_newton, with_untangler, rested_newton_, failed_starts_, raises_);
  raiser_.state(archive);
  if constexpr (Archive::kReads) {
    const bool fits = (failed_starts_.empty() && !with_untangler) ||
                      failed_starts_.size() == static_cast<std::size_t>(problem_.cells);
    if (archive.failed() || !fits || (with_newton && hessian_ == nullptr)) return archive.fail();
    if (with_newton) newton();
    if (with_untangler) {
      sweeper_.rebuild();
      untangler_.emplace(Untangler::ToBeRead{}, problem_, kernels_, guard_, team_, failed_starts_, depth_,
                         room_for_hessians(mesh_, options_), spare_memory_);
    }
  }
  if (with_newton) newton_->state(archive);
  if (with_untangler) untangler_->state(archive);
}

void StageRun::free_methods() {
  newton_.reset();
  untangler_.reset();
  std::vector<char>().swap(rested_newton_);
  drop_deformation(problem_);
}

void StageRun::add(const DescentRound& round) {
  const int number = iteration_.number + 1;
  iteration_ = {};
  iteration_.phase = Phase::Accuracy;
  iteration_.number = number;
  iteration_.energy = round.energy;
  iteration_.residual = round.residual;
  iteration_.relative_gradient = round.relative_gradient;
  iteration_.min_scaled_jacobian = round.min_scaled_jacobian;
  iteration_.invalid_elements = guard_.uncertified();
  iteration_.repairable_elements = guard_.repairable();
  iteration_.left_elements = guard_.fewest();
  iteration_.active_nodes = static_cast<std::int64_t>(problem_.free.size());
  iteration_.products = round.steps;
  iteration_.on_device = round.on_device;
  iteration_.seconds = seconds();
  history_.push_back(iteration_);
}

bool StageRun::is_near_optimum() const { return full_step_ && iteration_.residual <= kNearOptimum; }

bool StageRun::resume(std::string_view checkpoint, std::uint64_t fingerprint, const ReadRest& read_rest) {
  CheckpointReader reader(checkpoint, fingerprint);
  if (!reader.failed()) state(reader);
  bool has_rest = false;
  if (!reader.failed()) reader(has_rest);
  if (has_rest && read_rest) read_rest(reader);
  if (reader.failed() || history_.empty()) return false;
  if (device_ != nullptr) device_->began_on(std::string(device_before_.begin(), device_before_.end()));
  iteration_ = history_.back();
  exact_ = true;
  watch_ = Stopwatch::started(iteration_.seconds);
  return true;
}

bool StageRun::write(const CheckpointSink& sink, std::uint64_t fingerprint, const WriteRest& write_rest) {
  CheckpointWriter writer(sink, fingerprint);
  state(writer);
  const bool has_rest = write_rest != nullptr;
  writer(has_rest);
  if (has_rest) write_rest(writer);
  return writer.finish();
}

}  // namespace varimesh
