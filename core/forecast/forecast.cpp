#include "core/forecast/forecast.h"

#include <algorithm>
#include <cmath>

namespace varimesh {
namespace {

constexpr std::size_t kKept = 20, kFew = 3;
constexpr double kFastest = 0.02, kSlowest = 0.85;
/// Newton's method near the optimum squares its residual, less what its linear systems leave.
constexpr double kOrder = 1.5;

// Measured on the cases of tests/bench/time_left and some twenty others: docs/notes/time-left.md.

/// The time of a Newton step in units of a sweep, for as long as no Newton step was timed.
constexpr double kSweepsOfANewtonStep = 6;
/// Sweeps that follow one, and Newton steps that follow sweeps or untangling.
constexpr double kMoreSweeps = 6, kMoreNewtonSteps = 5, kMoreUntangling = 5;
/// All Newton steps of a run in which cells stay that are not certified valid; fewer if the descent follows. Untangling
/// comes between them, in units of a Newton step.
constexpr double kStepsForInvalid = 32, kStepsBeforeDescent = 12, kUntangling = 6;
/// The least number of Newton steps that are expected while cells are not certified valid.
constexpr double kLeastSteps = 3;
/// In units of a Newton step: all rounds of a mesh that is valid by then, and of one that is not; the later stages.
constexpr double kRoundsOfValid = 30, kRoundsOfInvalid = 60, kLaterStages = 9;
/// The rounds of a mesh that stays invalid do not come to rest. They end when they gain nothing, as a rule after so
/// many.
constexpr int kRoundsInVain = 5;
/// Rounds of a descent whose moves fall at no clear rate, and the most.
constexpr double kUnclearRounds = 4, kMostRounds = 6;
/// Another descent begins where the last one ended. Few follow the second.
constexpr double kNextDescent = 0.8, kLaterDescent = 0.3;
/// Other ways together take as long as the run before them, as a rule, and at most five times as long: the bounds of
/// work in core/optimise/sequences/attempts.cpp.
constexpr double kOtherWays = 1, kMostOtherWays = 5;
/// If one takes longer than the others: this share of what it has taken is left of it.
constexpr double kOverdue = 0.2;

}  // namespace

Forecast::Rules Forecast::rules_of(const Options& options) {
  const bool ends_with_energy = options.objective == Objective::Energy || options.until == Until::Valid;
  return {.goal = ends_with_energy                        ? Goal::Energy
                  : options.objective == Objective::Worst ? Goal::Minimum
                                                          : Goal::Loss,
          .only_sweeps = options.method == varimesh::Method::Sweeps,
          .tolerance = options.tolerance,
          .time_limit = options.time_limit};
}

// ===== the last few =====

void Forecast::Last::add(double seconds, double size) {
  seen_.push_back({seconds, size});
  if (seen_.size() > kKept) seen_.pop_front();
}

double Forecast::Last::mean(std::size_t of) const {
  const std::size_t count = std::min(of, seen_.size());
  double sum = 0;
  for (std::size_t i = seen_.size() - count; i < seen_.size(); ++i) sum += seen_[i].seconds;
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

double Forecast::Last::ratio(std::size_t of) const {
  const std::size_t steps = seen_.empty() ? 0 : std::min(of, seen_.size() - 1);
  if (steps == 0) return 1;
  const double first = seen_[seen_.size() - 1 - steps].size, last = seen_.back().size;
  return last < first ? std::max(kFastest, std::pow(last / first, 1.0 / static_cast<double>(steps))) : 1;
}

// ===== the energy =====

double Forecast::newton_time() const {
  return newton_.count() > 0 ? newton_.mean(kFew) : kSweepsOfANewtonStep * sweeps_.mean(kFew);
}

double Forecast::left_of_invalid() const {
  const double steps = rules_.goal == Goal::Loss ? kStepsBeforeDescent : kStepsForInvalid;
  const double untangling = untangling_.count() == 0 ? kUntangling : 0;
  return (std::max(kLeastSteps, steps - newton_steps_) + untangling) * newton_time();
}

double Forecast::left_of_sweeps(double residual, bool is_valid) const {
  if (!rules_.only_sweeps)
    return kMoreSweeps * sweeps_.mean(kFew) + (is_valid ? kMoreNewtonSteps * newton_time() : left_of_invalid());
  const double falls = sweeps_.ratio(kKept);
  const bool is_known = falls < 1 && residual > rules_.tolerance && rules_.tolerance > 0;
  return sweeps_.mean(kKept) * (is_known ? std::log(rules_.tolerance / residual) / std::log(falls) : kMoreSweeps);
}

double Forecast::left_of_newton(double residual, bool is_valid) const {
  if (!is_valid) return left_of_invalid();
  double falls = std::min(newton_.ratio(1), kSlowest);
  std::size_t steps = 0;
  for (double size = residual; size > rules_.tolerance && steps < kKept; ++steps) {
    size *= falls;
    falls = std::max(kFastest, std::pow(falls, kOrder));
  }
  return static_cast<double>(steps) * newton_time();
}

double Forecast::after_energy(bool is_valid) const {
  if (rules_.goal == Goal::Energy) return 0;
  if (rules_.goal == Goal::Minimum) return is_valid ? kLaterStages * newton_time() : 0;
  return (is_valid ? kRoundsOfValid : kRoundsOfInvalid) * newton_time();
}

void Forecast::step(Method method, double residual, const State& state) {
  const double seconds = state.now - last_;
  last_ = state.now;
  double left = 0;
  switch (method) {
    case Method::Sweep:
      sweeps_.add(seconds, residual);
      left = left_of_sweeps(residual, state.is_valid);
      break;
    case Method::Newton:
      newton_.add(seconds, residual);
      ++newton_steps_;
      left = left_of_newton(residual, state.is_valid);
      break;
    case Method::Untangle:
      untangling_.add(seconds, residual);
      left = kMoreUntangling * untangling_.mean(kFew) +
             (state.is_valid ? kMoreNewtonSteps * newton_time() : left_of_invalid());
      break;
  }
  // Before untangling, nobody knows what will be left. The stages that raise the minimum make more cells valid.
  State later = state;
  later.hopes = state.hopes && untangling_.count() > 0 && rules_.goal == Goal::Loss;
  expect(left + after_energy(state.is_valid), later);
}

// ===== the descents =====

void Forecast::descent(double now) {
  if (rounds_.count() > 0) last_descent_ = last_ - descent_began_;
  rounds_.clear();
  descent_began_ = last_ = now;
}

double Forecast::left_of_rounds(double move, double rest, const State& state) const {
  const double round = rounds_.mean(kFew);
  if (!state.is_valid) return std::max(1, kRoundsInVain - all_rounds_) * round;
  const double falls = rounds_.ratio(kFew);
  if (falls < kSlowest && move > 0) {
    const double more = std::ceil(std::log(rest * (1 - falls) / (falls * move)) / std::log(falls));
    return std::clamp(more, 0.0, kMostRounds) * round;
  }
  // As many rounds as in the descent before, if there was one.
  const double spent = state.now - descent_began_;
  return last_descent_ > spent ? last_descent_ - spent : kUnclearRounds * round;
}

void Forecast::round(double move, double rest, bool another, const State& state) {
  rounds_.add(state.now - last_, move);
  last_ = state.now;
  ++all_rounds_;
  const double left = left_of_rounds(move, rest, state), whole = state.now - descent_began_ + left;
  expect(left + (another && state.is_valid ? (last_descent_ > 0 ? kLaterDescent : kNextDescent) * whole : 0), state);
}

// ===== the whole =====

void Forecast::expect(double left, const State& state) {
  left_ = left + (state.hopes ? kOtherWays * (state.now + left) : 0) + end_;
  left_at_ = state.now;
  past_.add(left_at_, *left_);
}

double Forecast::way_time() const {
  return ended_ways_.count() > 0 ? ended_ways_.mean(kKept) : kOtherWays * run_ / ways_;
}

double Forecast::most_of_ways(double now) const { return kMostOtherWays * run_ - (now - ways_began_); }

void Forecast::other_way(double now, int ways) {
  if (ways_ == 0)
    run_ = ways_began_ = now;
  else if (whole_run_)
    ways_began_ += now - way_began_;
  else
    ended_ways_.add(now - way_began_, 1);
  whole_run_.reset();
  ways_ = ways;
  way_began_ = now;
  left_ = std::min(ways * way_time(), most_of_ways(now));
  left_at_ = now;
  past_.add(now, *left_);
}

Forecast& Forecast::whole_run(double now, const Rules& rules) {
  way_began_ = now;
  whole_run_ = std::make_unique<Forecast>(rules);
  whole_run_->judged_in(end_);
  return *whole_run_;
}

std::optional<double> Forecast::seconds_left(double now) const {
  std::optional<double> left;
  if (whole_run_)
    left = whole_run_->seconds_left(now - way_began_);
  else if (left_ && past_.agree())
    left = *left_ - (now - left_at_);
  // A way that takes longer than the others will not end at once.
  if (left && ways_ > 0 && !whole_run_)
    left = std::min(most_of_ways(now), std::max(*left, kOverdue * (now - way_began_) + (ways_ - 1) * way_time()));
  if (left && *left < -PastForecasts::kSeconds) left.reset();
  if (left) left = std::max(0.0, *left);
  if (rules_.time_limit <= 0) return left;
  const double limit = std::max(0.0, rules_.time_limit - now);
  if (left) return std::min(*left, limit);
  // A run that has taken half of its time takes the rest as well, as a rule.
  return limit <= now ? std::optional(limit) : std::nullopt;
}

}  // namespace varimesh
