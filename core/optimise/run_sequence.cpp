#include "core/optimise/run_sequence.h"

#include <algorithm>
#include <utility>

namespace varimesh {

RunSequence::RunSequence(const Options& options, const OnIteration& on_iteration, const RunControl& control)
    : options_(options), on_iteration_(on_iteration) {
  control_.threads = control.threads;
  control_.stop_asked = control.stop_asked;
  options_.repair = Repair::Report;
  options_.order = 0;
}

bool RunSequence::may_go_on() const {
  return !stopped_ && static_cast<int>(history_.size()) < options_.max_iterations &&
         (options_.time_limit <= 0 || watch_.seconds() < options_.time_limit);
}

bool RunSequence::stop_asked() {
  stopped_ = stopped_ || (control_.stop_asked && control_.stop_asked());
  return stopped_;
}

std::optional<Result> RunSequence::run(const HighOrderMesh& mesh) {
  return run(mesh, options_.max_iterations - static_cast<int>(history_.size()));
}

std::optional<Result> RunSequence::judge(const HighOrderMesh& mesh) { return run(mesh, 0); }

std::optional<Result> RunSequence::run(const HighOrderMesh& mesh, int max_iterations) {
  Options options = options_;
  options.max_iterations = max_iterations;
  if (options_.time_limit > 0) options.time_limit = std::max(1e-3, options_.time_limit - watch_.seconds());
  const int before = static_cast<int>(history_.size());
  const double seconds = watch_.seconds();
  const OnIteration pass_on = [&](Iteration iteration) {
    iteration.number += before;
    iteration.seconds += seconds;
    history_.push_back(iteration);
    return on_iteration_ ? on_iteration_(iteration) : Control::Continue;
  };
  Expected<Result> result = optimise(mesh, options, pass_on, control_);
  if (!result) return std::nullopt;
  stopped_ = stopped_ || result->stopped;
  return std::move(*result);
}

void RunSequence::finish(Result& result) {
  result.history = std::move(history_);
  result.iterations = static_cast<int>(result.history.size());
  result.seconds = watch_.seconds();
  result.stopped = stopped_;
  if (stopped_) {
    result.stop_reason = StopReason::Stopped;
  } else if (!result.after.uncertified.empty()) {  // without the limits, more would have been tried
    if (options_.time_limit > 0 && result.seconds >= options_.time_limit) result.stop_reason = StopReason::TimeLimit;
    if (result.iterations >= options_.max_iterations) result.stop_reason = StopReason::Iterations;
  }
}

}  // namespace varimesh
