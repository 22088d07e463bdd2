#include "core/optimise/phases.h"

#include <algorithm>

#include "core/merit/merit.h"

namespace varimesh {
namespace {

constexpr int kPatience = 10;  // iterations that a phase may take without fewer uncertified cells
constexpr int kSweepsWhenStuck = 5;
constexpr int kMostTimesStuck = 3;
constexpr int kMostTimesUntangled = 3;
constexpr int kMostWithoutFewer = 10;  // iterations without fewer uncertified cells before validity is given up

}  // namespace

bool PhaseChooser::may_untangle(std::int64_t unrepaired) const {
  return method_ == Method::Auto && unrepaired > 0 &&
         (times_untangled_ == 0 ||
          (times_untangled_ < kMostTimesUntangled && (unrepaired < untangled_from_ || fewest_ < fewest_before_)));
}

Outlook PhaseChooser::outlook(std::int64_t unrepaired) const {
  if (method_ != Method::Auto || unrepaired == 0) return Outlook::Nothing;
  if (phase_ == Phase::Untangle || !newton_tried_ || may_untangle(unrepaired)) return Outlook::AnotherMethod;
  return patience_ > 0 ? Outlook::Patience : Outlook::Nothing;
}

bool PhaseChooser::next(std::int64_t repairable, std::int64_t unrepaired, bool stuck) {
  if (method_ == Method::Sweeps) return true;
  if (repairable < fewest_) {
    fewest_ = repairable;
    patience_ = std::max(patience_, kPatience);
  }
  --patience_;
  const bool stalled = stuck || patience_ <= 0;
  switch (phase_) {
    case Phase::Untangle:
      if (!stuck) return true;
      // If untangling certified nothing and Newton was tried before, there is nothing to wait for.
      turn_to(Phase::Newton, newton_tried_ && !may_untangle(unrepaired) ? 0 : kPatience);
      return true;
    case Phase::Newton:
      if (stalled && may_untangle(unrepaired)) {
        turn_to(Phase::Untangle, kPatience);
      } else if (stuck) {
        if (method_ == Method::Newton || ++times_stuck_ > kMostTimesStuck) return false;
        turn_to(Phase::Sweeps, kSweepsWhenStuck);
      }
      return true;
    case Phase::Sweeps:
      if (stalled || (repairable == 0 && times_stuck_ == 0)) turn_to(Phase::Newton, kPatience);
      return true;
    case Phase::Accuracy:  // comes after all phases of a stage; the chooser never names it
      return true;
  }
  return true;
}

void PhaseChooser::turn_to(Phase phase, int patience) {
  phase_ = phase;
  newton_tried_ = newton_tried_ || phase == Phase::Newton;
  patience_ = patience;
}

void PhaseChooser::untangling_from(std::int64_t unrepaired) {
  ++times_untangled_;
  untangled_from_ = unrepaired;
  fewest_before_ = fewest_;
}

bool Stopper::asks_for_proof(const Iteration& iteration) const {
  const Asked asked = asked_by(options_);
  return asked.what == Asked::What::Loss && iteration.invalid_elements == 0 &&
         iteration.min_scaled_jacobian >= asked.bound;
}

std::optional<StopReason> Stopper::after(const Iteration& iteration, bool converged, Outlook outlook, double bound) {
  if (fewest_ < 0 || iteration.invalid_elements < fewest_) {
    fewest_ = iteration.invalid_elements;
    without_fewer_ = 0;
  } else {
    ++without_fewer_;
  }
  const bool last = outlook != Outlook::AnotherMethod;
  const bool gives_up =
      iteration.invalid_elements > 0 && without_fewer_ >= kMostWithoutFewer && outlook == Outlook::Nothing;
  has_just_given_up_ = gives_up && !has_given_up_;
  has_given_up_ = has_given_up_ || gives_up;
  const bool for_accuracy = asked_by(options_).what == Asked::What::Loss;
  if (options_.until == Until::Valid || for_accuracy) {
    // The descent keeps the bound on the scaled Jacobian more easily than it reaches it.
    const bool goes_on = for_accuracy && !(asks_for_proof(iteration) && bound >= options_.min_js);
    if (iteration.invalid_elements == 0 && !goes_on) return StopReason::Valid;
    if (iteration.invalid_elements > 0 && iteration.repairable_elements == 0 && last) return StopReason::Repaired;
    // Once the mesh was valid, the energy goes on for the bound, and cells that lose their certificate come back.
    if (gives_up && fewest_ > 0) return StopReason::NoProgress;
  }
  if (options_.until_js > 0 && bound >= options_.until_js) return StopReason::Quality;
  if (converged && last) return StopReason::Converged;
  if (options_.time_limit > 0 && iteration.seconds >= options_.time_limit) return StopReason::TimeLimit;
  if (iteration.number >= options_.max_iterations) return StopReason::Iterations;
  return std::nullopt;
}

}  // namespace varimesh
