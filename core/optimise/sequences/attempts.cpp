#include "core/optimise/sequences/attempts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/forecast/forecast.h"
#include "core/layers/error/layer_error.h"
#include "core/merit/merit.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/memory.h"
#include "core/optimise/run.h"
#include "core/optimise/sequences/ways.h"
#include "core/optimise/sequences/work.h"
#include "core/ranks/ranks.h"

namespace varimesh {
namespace {

/// The most bytes that the attempt at the next order may need beyond what the run does: it is worth a hint only.
constexpr std::int64_t kMemoryOfAHint = std::int64_t{16} << 20;

/// The work of all attempts, as a multiple of that of the run before. Each but the plain energy's does at most as much
/// as that run.
constexpr double kTimesTheWork = 2;

/// The work of the plain energy's attempt, as a multiple of that of all. Round an ellipse with coarse layers of order 4
/// the work of all is just too little until every element is valid.
constexpr double kTimesForEnergy = 2;

/// After a short run, each attempt may do this much, and all together as much as all ways need for that: about a second
/// each. A mesh of nine elements needs .7 of it until Winslow's energy has untangled it.
constexpr double kLeastWorkOfAttempt = 1e6;

std::int64_t left(const Result& result) { return merit_of(result.after).uncertified; }

/// Whether a cell is left that may still become valid. Of a group that movement cannot repair, one cell has to stay
/// invalid, and the others need not.
bool leaves_hope(const Result& result) {
  const std::vector<std::int64_t> uncertified = uncertified_numbers(result.after);
  if (uncertified.size() > least_invalid(with_any_of(result.unrepairable, uncertified))) return true;
  if (uncertified.empty()) return false;
  const Cells cells(result.mesh, result.mesh.dimension);
  const std::vector<char> hopeless = cells_beyond_repair(result.unrepairable, cells.count());
  std::vector<std::int64_t> hopeless_numbers;
  for (std::size_t cell = 0; cell < hopeless.size(); ++cell)
    if (hopeless[cell] != 0) hopeless_numbers.push_back(cells.number(cell));
  std::ranges::sort(hopeless_numbers);
  return !std::ranges::all_of(
      uncertified, [&](std::int64_t number) { return std::ranges::binary_search(hopeless_numbers, number); });
}

/// Whether the objective is to raise the smallest scaled Jacobian, and the default objective may raise it further.
bool may_rise(const Options& options, const Result& result) {
  constexpr double kHardlyToBeRaised = 0.95;
  return options.objective == Objective::Worst && options.until != Until::Valid &&
         merit_of(result.after).smallest < kHardlyToBeRaised;
}

/// Whether the descent has found no way down from a valid mesh, although it looked for one. Layers that are held count
/// as found: an energy would move their nodes.
bool has_stayed(const SetUp& set_up, const Result& result) {
  return set_up.layers.held.empty() && set_up.options.objective == Objective::Accuracy &&
         set_up.options.until != Until::Valid && left(result) == 0 && result.iterations > 0 &&
         set_up.as_it_came.empty() && result.mesh.coordinates == set_up.mesh.coordinates;
}

/// Whether small patches have made the mesh valid after the descent. While cells are invalid, a descent cannot lower
/// the loss as far.
bool was_made_valid_late(const SetUp& set_up, const Result& result) {
  return result.made_valid_at_end > 0 && set_up.options.objective == Objective::Accuracy &&
         set_up.options.until != Until::Valid && left(result) == 0 && result.kept_as_it_came.empty();
}

/// How good the mesh is, as the end of a sentence.
std::string outcome_text(const Result& result) {
  const Merit merit = merit_of(result.after);
  char text[128];
  if (const std::int64_t count = left(result); count > 0) {
    std::snprintf(text, sizeof text, ", the smallest scaled Jacobian is %.3g", merit.smallest);
    return std::to_string(count) + (count == 1 ? " element is" : " elements are") + " not certified valid" + text;
  }
  std::snprintf(text, sizeof text, "every element is valid, the smallest scaled Jacobian is %.3g", merit.smallest);
  if (merit.loss == 0 || !std::isfinite(merit.loss)) return text;  // straight-sided elements have no loss
  char loss[32];
  std::snprintf(loss, sizeof loss, ", the loss is %.3g", merit.loss);
  return std::string(text) + loss;
}

/// try_other_ways(), with or without the mesh raised by one order as the last attempt.
OtherWays try_ways(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop,
                   Result& result, bool raises_order);

class Attempts {
 public:
  Attempts(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop, Result& result,
           bool raises_order)
      : set_up_(set_up),
        on_iteration_(on_iteration),
        control_(control),
        stop_(stop),
        result_(result),
        raises_order_(raises_order) {
    forecast_ = std::exchange(control_.forecast, nullptr);  // of what the ways do by themselves it knows nothing
    control_.checkpoint = {};
    control_.checkpoint_due = nullptr;
    control_.save_checkpoint = nullptr;
    for (const Iteration& iteration : result.history) most_work_ += work_of(iteration);
    work_of_each_ = std::max(most_work_, kLeastWorkOfAttempt);
    most_work_ = std::max(kTimesTheWork * work_of_each_, static_cast<double>(kWays.size()) * kLeastWorkOfAttempt);
  }

  OtherWays run() {
    free_tables();
    if (was_made_valid_late(set_up_, result_)) go_on();
    std::optional<Result> best;
    const Way* way = nullptr;
    for (const Way& each : kWays) {
      const Result& so_far = best ? *best : result_;
      if (!may_go_on() || !is_wanted(so_far)) break;
      if (!is_for(each, so_far)) continue;
      expect_ways(
          std::count_if(&each, kWays.data() + kWays.size(), [&](const Way& way) { return is_for(way, so_far); }));
      std::optional<Result> other = try_way(each);
      if (!other) continue;
      tried_ += (tried_.empty() ? "" : ", ") + std::string(each.name);
      if (!should_take(*other, so_far)) continue;
      best = std::move(other);
      way = &each;
    }
    if (best)
      take(std::move(*best), *way);
    else if (!tried_.empty() && leaves_hope(result_))
      result_.notes.push_back("Tried in vain for what is left: " + tried_ + ".");
    OtherWays ways{true, {}};
    if (raises_order_ && leaves_hope(result_)) ways.left_at_next_order = left_at_next_order();
    finish();
    return ways;
  }

 private:
  std::optional<Result> try_way(const Way& way) {
    Options options = with_way(set_up_.options, way);
    options.max_iterations -= (options.max_iterations - result_.iterations) / 2;  // others may follow
    if (way.objective == Objective::Auto) return run_with(options, std::numeric_limits<double>::infinity());
    if (is_plain_energy(options)) return run_with(options, kTimesForEnergy * most_work_);
    return run(options, set_up_.mesh.coordinates);
  }

  /// Runs with at most this much work. What goes beyond the share of an attempt is not taken from the others, and a run
  /// without bound takes nothing from them.
  std::optional<Result> run_with(const Options& options, double most_work) {
    const double work = work_;
    const double all = std::exchange(most_work_, most_work), of_each = std::exchange(work_of_each_, most_work);
    std::optional<Result> result = run(options, set_up_.mesh.coordinates);
    work_ = std::isinf(most_work) ? work : std::min(work_, work + of_each);
    most_work_ = all;
    work_of_each_ = of_each;
    return result;
  }

  /// Tells the forecast that another way begins, and that at most `ways` are tried from here on, this one included.
  void expect_ways(std::ptrdiff_t ways) const {
    if (forecast_ != nullptr) forecast_->other_way(seconds(), static_cast<int>(ways));
  }

  bool is_wanted(const Result& result) const {
    return leaves_hope(result) || may_rise(set_up_.options, result) || has_stayed(set_up_, result);
  }

  /// Whether this way is another one than that of the run, and fits what is wanted.
  bool is_for(const Way& way, const Result& result) const {
    const Options& options = set_up_.options;
    if (way.objective == Objective::Auto) return options.objective == Objective::Worst;
    if (left(result) == 0) return has_stayed(set_up_, result) && way.constants == Constants::Reference;
    if (!leaves_hope(result)) return false;
    const bool is_same =
        options.energy == way.energy && options.target == way.target && options.constants == way.constants;
    return options.objective == Objective::Accuracy || !is_same;
  }

  bool should_take(const Result& other, const Result& so_far) const {
    if (loses_layers(result_.before, other.after, set_up_.options)) return false;
    const bool came_valid = result_.before.uncertified.empty();
    Asked asked = set_up_.options.objective == Objective::Worst ? kAskForMinimum : Asked{};
    if (came_valid) {
      asked = asked_by(set_up_.options);
      asked.loss_as_it_came = merit_of(result_.before).loss;
    }
    return is_better(merit_of(other.after), merit_of(so_far.after), asked);
  }

  bool may_go_on() const {
    const Options& options = set_up_.options;
    return !stopped_ && work_ < most_work_ && !stop_.stopped_together() &&
           result_.iterations < options.max_iterations && (options.time_limit <= 0 || seconds() < options.time_limit);
  }
  /// With ranks, those of the slowest: all call it together.
  double seconds() const {
    const double mine = result_.seconds + watch_.seconds();
    return control_.ranks != nullptr ? control_.ranks->largest(mine) : mine;
  }

  /// Attempts have set-ups of their own, so that of the run keeps only the mesh.
  void free_tables() {
    set_up_.problem = {};
    set_up_.coloured = {};
    set_up_.stages.clear();
    set_up_.is_spent = true;
  }

  /// Runs with these options from these coordinates, and raises the mesh to another order first if there is one.
  /// Nothing if the mesh is refused.
  std::optional<Result> run(Options options, std::vector<double> coordinates, int order = 0) {
    options.order = order;
    options.max_iterations -= result_.iterations;
    const double begun = seconds();
    if (options.time_limit > 0) options.time_limit = std::max(1e-9, options.time_limit - begun);
    CheckedMesh mesh{set_up_.mesh, set_up_.facets};
    mesh.mesh.coordinates = std::move(coordinates);
    auto prepared = varimesh::set_up(std::move(mesh), options, &stop_);
    if (!prepared) return std::nullopt;
    const auto numbered_through = [before = result_.iterations, begun](Iteration iteration) {
      iteration.number += before;
      iteration.seconds += begun;
      return iteration;
    };
    const double most = std::min(most_work_, work_ + work_of_each_);
    const OnIteration pass_on = [&](const Iteration& own) {
      work_ += work_of(own);
      stopped_ = on_iteration_ && on_iteration_(numbered_through(own)) == Control::Stop;
      return stopped_ || work_ >= most ? Control::Stop : Control::Continue;
    };
    RunControl control = control_;
    const bool is_whole = std::isinf(work_of_each_);
    if (is_whole && forecast_ != nullptr)
      control.forecast = &forecast_->whole_run(begun, Forecast::rules_of((*prepared)->options));
    control.mesh_wanted = nullptr;  // only the best of them is handed out
    // Larger patches take most of the time of a run that is not short, and it has untangled them in vain.
    const bool is_shallow = options.objective == Objective::Energy && !is_plain_energy(options);
    control.shallow_untangling = control.shallow_untangling || (is_shallow && work_of_each_ > kLeastWorkOfAttempt);
    Result result = Run(**prepared, pass_on, control, stop_).go();
    // Objective::Worst ends no lower than the default, attempts included. And what is said of the next order is what
    // the default reaches there.
    if (options.objective != set_up_.options.objective || order != 0)
      try_ways(**prepared, pass_on, control, stop_, result, false);
    // A set-up for another objective looks for no layers.
    if (order == 0 && result_.before.in_layers && !result.after.in_layers)
      result.after.in_layers = layer_error(result.mesh, set_up_.facets, Team(set_up_.options.threads), &set_up_.mesh);
    for (const Iteration& iteration : result.history) result_.history.push_back(numbered_through(iteration));
    result_.iterations += result.iterations;
    result_.proof_seconds += result.proof_seconds;
    const bool used_up = result.stopped && !stopped_ && stop_.reason() != StopToken::Reason::Asked;
    const bool used_its_share =
        result.stop_reason == StopReason::Iterations && result_.iterations < set_up_.options.max_iterations;
    if (used_up || used_its_share) {  // which no limit of the caller has ended
      result.stopped = false;
      result.stop_reason = StopReason::NoProgress;
    }
    return result;
  }

  /// How many elements are left if the mesh as it came is raised by one order; nothing if no fewer, or not known.
  std::optional<std::int64_t> left_at_next_order() {
    const int order = set_up_.mesh.order + 1;
    if (order > kMaxOrder || !may_go_on()) return std::nullopt;
    Options options = set_up_.options;
    options.objective = Objective::Auto;
    options.min_js = Options().min_js;
    options.until = Until::Valid;
    options.order = order;
    if (memory_needed(set_up_.mesh, options) > memory_needed(set_up_.mesh, set_up_.options) + kMemoryOfAHint)
      return std::nullopt;
    expect_ways(1);
    const std::optional<Result> raised = run(options, set_up_.mesh.coordinates, order);
    return raised && left(*raised) < left(result_) ? std::optional(left(*raised)) : std::nullopt;
  }

  /// Runs from this mesh as the run would have. Nothing if there are no means left, or the mesh is refused.
  std::optional<Result> run_from(const HighOrderMesh& mesh) {
    if (!may_go_on()) return std::nullopt;
    most_work_ += work_;
    work_of_each_ = most_work_;  // this run is no attempt
    expect_ways(1);
    return run(set_up_.options, mesh.coordinates);
  }

  /// Goes on from the mesh of the run, which small patches have made valid at its end.
  void go_on() {
    std::optional<Result> whole = run_from(result_.mesh);
    if (!whole || !is_better(merit_of(whole->after), merit_of(result_.after), asked_by(set_up_.options))) return;
    result_.notes.emplace_back("The run went on from there.");
    std::ranges::move(whole->notes, std::back_inserter(result_.notes));
    take_outcome(std::move(*whole));
  }

  /// Takes this result of an attempt, after going on from its mesh as the run would have.
  void take(Result best, const Way& way) {
    const std::string before = outcome_text(result_), after = outcome_text(best);
    std::optional<Result> whole = run_from(best.mesh);
    const bool may_take = whole && !loses_layers(result_.before, whole->after, set_up_.options);
    if (may_take && !should_take(best, *whole)) best = std::move(*whole);
    if (has_stayed(set_up_, result_)) result_.notes.clear();  // they say that nothing was moved
    result_.notes.push_back("By the run's own way, " + before + ". With " + way.name + ", " + after +
                            ". So the run went on from there.");
    take_outcome(std::move(best));
  }

  /// The mesh, and how the run that has made it ended.
  void take_outcome(Result best) {
    result_.mesh = std::move(best.mesh);
    result_.after = std::move(best.after);
    result_.residual = best.residual;
    result_.converged = best.converged;
    result_.stopped = best.stopped;
    result_.stop_reason = best.stop_reason;
    result_.substitute_targets = std::move(best.substitute_targets);
    result_.kept_as_it_came.clear();
  }

  void finish() {
    result_.seconds = seconds();
    const bool asked = stopped_ || stop_.reason() == StopToken::Reason::Asked;
    if (asked) {
      result_.stopped = true;
      result_.stop_reason = StopReason::Stopped;
    } else if (!result_.after.uncertified.empty()) {  // without the limits, more would have been tried
      const Options& options = set_up_.options;
      if (stop_.reason() == StopToken::Reason::TimeLimit) result_.stop_reason = StopReason::TimeLimit;
      if (result_.iterations >= options.max_iterations) result_.stop_reason = StopReason::Iterations;
    }
    result_.converged = result_.converged && result_.stop_reason == StopReason::Converged;
  }

  SetUp& set_up_;
  const OnIteration& on_iteration_;
  RunControl control_;
  Forecast* forecast_ = nullptr;
  StopToken& stop_;
  Result& result_;
  Stopwatch watch_;
  double work_ = 0, most_work_ = 0, work_of_each_ = 0;
  bool stopped_ = false;
  const bool raises_order_;
  std::string tried_;
};

OtherWays try_ways(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop,
                   Result& result, bool raises_order) {
  const bool is_wanted = leaves_hope(result) || may_rise(set_up.options, result) || has_stayed(set_up, result) ||
                         was_made_valid_late(set_up, result);
  const bool another_mends = control.another_follows && left(result) > 0;
  const bool may = is_wanted && !another_mends && set_up.may_try_other_ways && !result.stopped &&
                   !was_cut_short(result) && !stop.stopped() && result.iterations > 0;
  if (!may) return {};
  return Attempts(set_up, on_iteration, control, stop, result, raises_order).run();
}

}  // namespace

OtherWays try_other_ways(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop,
                         Result& result) {
  return try_ways(set_up, on_iteration, control, stop, result, true);
}

}  // namespace varimesh
