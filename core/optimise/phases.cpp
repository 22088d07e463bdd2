#include "core/optimise/phases.h"

#include <algorithm>

namespace varimesh {
namespace {

constexpr int kPatience = 10;  // sweeps without fewer uncertified cells
constexpr int kSweepsWhenStuck = 5;
constexpr int kMostTimesStuck = 3;
constexpr int kMostWithoutFewer = 10;  // iterations, with Until::Valid

}  // namespace

bool PhaseChooser::next(std::int64_t repairable, bool stuck) {
  if (method_ == Method::Sweeps) return true;
  if (newton_ && stuck) {
    if (method_ == Method::Newton || ++times_stuck_ > kMostTimesStuck) return false;
    newton_ = false;
    patience_ = kSweepsWhenStuck;
    return true;
  }
  if (newton_) return true;
  if (repairable < fewest_) {
    fewest_ = repairable;
    patience_ = std::max(patience_, kPatience);
  }
  newton_ = (repairable == 0 && times_stuck_ == 0) || --patience_ <= 0;
  return true;
}

std::optional<StopReason> Stopper::after(const Iteration& iteration, bool converged, double bound) {
  if (fewest_ < 0 || iteration.invalid_elements < fewest_) {
    fewest_ = iteration.invalid_elements;
    without_fewer_ = 0;
  } else {
    ++without_fewer_;
  }
  if (options_.until == Until::Valid) {
    if (iteration.invalid_elements == 0) return StopReason::Valid;
    if (iteration.repairable_elements == 0) return StopReason::Repaired;
    if (without_fewer_ >= kMostWithoutFewer) return StopReason::NoProgress;
  }
  if (options_.until_js > 0 && bound >= options_.until_js) return StopReason::Quality;
  if (converged) return StopReason::Converged;
  if (options_.time_limit > 0 && iteration.seconds >= options_.time_limit) return StopReason::TimeLimit;
  if (iteration.number >= options_.max_iterations) return StopReason::Iterations;
  return std::nullopt;
}

}  // namespace varimesh
