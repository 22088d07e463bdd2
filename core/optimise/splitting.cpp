// Rounds of splitting and optimising; the best mesh is kept.
#include "core/optimise/splitting.h"

#include <Eigen/LU>
#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "core/base/index.h"
#include "core/base/stopwatch.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/grace.h"
#include "core/reference/basis.h"
#include "core/repair/split_passes.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr int kMostRounds = 4;
/// Newton steps before the first split. On meshes that stay tangled, Newton does not end by itself.
constexpr int kBriefIterations = 40;
/// The iterations of all rounds together, as a multiple of those without a split, and at least.
constexpr int kTimesTheIterations = 9, kLeastIterations = 200;

// ---------------------------------------------------------------------------------------------------------------------
// Several runs that share their limits
// ---------------------------------------------------------------------------------------------------------------------

/// Runs that a caller sees as one: iterations are numbered through, and the limits are for all of them together. The
/// sequence begins when it is constructed, and `on_iteration` must outlive it.
class RunSequence {
 public:
  RunSequence(const Options& options, const OnIteration& on_iteration, const RunControl& control, const StopToken& stop)
      : options_(options), on_iteration_(on_iteration), stop_(stop) {
    control_.threads = control.threads;
    control_.stop_asked = control.stop_asked;
    control_.shallow_untangling = true;
    options_.repair = Repair::Report;
    options_.order = 0;
    most_ = options_.max_iterations;
  }

  /// From now on at most this many more iterations.
  void allow(int iterations) {
    most_ = std::min(options_.max_iterations, static_cast<int>(history_.size()) + iterations);
  }

  /// From now on only the limits of the caller count.
  void allow_all() { most_ = options_.max_iterations; }

  /// Whether the limits allow another run, and no stop was asked for.
  bool may_go_on() const {
    return !stopped() && static_cast<int>(history_.size()) < most_ &&
           (options_.time_limit <= 0 || watch_.seconds() < options_.time_limit);
  }

  /// Whether the caller or the token has stopped the sequence.
  bool stopped() const { return stopped_ || stop_.stopped(); }
  const StopToken& token() const { return stop_; }

  /// Optimises the mesh with Repair::Report and in its own order, within what is left of the limits. Returns nothing if
  /// the mesh is refused.
  std::optional<Result> run(const HighOrderMesh& mesh) { return run(mesh, most_ - static_cast<int>(history_.size())); }

  /// The same without untangling, which takes most of the time where a split is needed.
  std::optional<Result> run_briefly(const HighOrderMesh& mesh) {
    const Method method = options_.method;
    if (method == Method::Auto) options_.method = Method::Newton;
    std::optional<Result> result = run(mesh, std::min(kBriefIterations, most_ - static_cast<int>(history_.size())));
    options_.method = method;
    return result;
  }

  /// Fills in what concerns the whole sequence: history, iterations, seconds and, if a limit or a stop ended it, the
  /// reason. Takes the history; call it once, at the end.
  void finish(Result& result) {
    result.history = std::move(history_);
    result.iterations = static_cast<int>(result.history.size());
    result.seconds = watch_.seconds();
    result.stopped = stopped_ || stop_.reason() == StopToken::Reason::Asked;
    if (result.stopped) {
      result.stop_reason = StopReason::Stopped;
    } else if (!result.after.uncertified.empty()) {  // without the limits, more would have been tried
      const bool is_over = options_.time_limit > 0 && result.seconds >= options_.time_limit;
      if (is_over || stop_.reason() == StopToken::Reason::TimeLimit) result.stop_reason = StopReason::TimeLimit;
      if (result.iterations >= options_.max_iterations) result.stop_reason = StopReason::Iterations;
    }
    // A run that the sequence has cut short was not ended by the caller's limit.
    if (result.stop_reason == StopReason::Iterations && result.iterations < options_.max_iterations)
      result.stop_reason = StopReason::NoProgress;
  }

 private:
  std::optional<Result> run(const HighOrderMesh& mesh, int max_iterations) {
    Options options = options_;
    options.max_iterations = max_iterations;
    // 0 would mean no limit. With so little time left, the run ends before its first iteration.
    if (options_.time_limit > 0) options.time_limit = std::max(1e-9, options_.time_limit - watch_.seconds());
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

  Options options_;
  const OnIteration& on_iteration_;
  const StopToken& stop_;
  RunControl control_;
  Stopwatch watch_;
  std::vector<Iteration> history_;
  int most_ = 0;  // iterations of all runs together
  bool stopped_ = false;
};

// ---------------------------------------------------------------------------------------------------------------------
// Rounds
// ---------------------------------------------------------------------------------------------------------------------

std::set<std::int64_t> uncertified_set(const Result& result) {
  const std::vector<std::int64_t> numbers = uncertified_numbers(result.after);
  return {numbers.begin(), numbers.end()};
}

/// Corners with J ≤ 0 of these tetrahedra in the optimised mesh. If a tetrahedron has no such corner, all its corners.
/// `numbers` are in ascending order.
std::vector<CellCorner> bad_corners(const Result& result, const std::vector<std::int64_t>& numbers) {
  const HighOrderMesh& mesh = result.mesh;
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  reference::Points vertices(4, 3);
  for (int v = 0; v < 4; ++v)
    for (int c = 0; c < 3; ++c) vertices(v, c) = reference::info(Shape::Tetrahedron).vertex[at(v)][at(c)];
  const auto gradients =
      reference::basis_gradients(Shape::Tetrahedron, mesh.order, reference::NodeSet::Equispaced, 3, vertices);
  std::vector<CellCorner> corners;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    if (!std::ranges::binary_search(numbers, cells.number(c))) continue;
    const auto nodes = cells.nodes(c);
    const Eigen::MatrixXd x = detail::node_positions(mesh.coordinates, nodes);
    std::vector<CellCorner> bad;
    for (int v = 0; v < 4; ++v) {
      Eigen::Matrix3d jacobian;
      for (int k = 0; k < 3; ++k) jacobian.row(k) = gradients[at(k)].row(v) * x;
      if (!(sign * jacobian.determinant() > 0)) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    }
    if (bad.empty())
      for (int v = 0; v < 4; ++v) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    corners.insert(corners.end(), bad.begin(), bad.end());
  }
  return corners;
}

/// Whether a has fewer uncertified elements than b or, if both have the same number, a higher minimum.
bool is_better(const Result& a, const Result& b) {
  const std::size_t left_a = a.after.uncertified.size(), left_b = b.after.uncertified.size();
  return left_a != left_b ? left_a < left_b : a.after.min_scaled_jacobian > b.after.min_scaled_jacobian;
}

/// Numbers of uncertified tetrahedra that a split may help, in ascending order: those without a folded boundary face.
std::vector<std::int64_t> worth_a_split(const Result& result) {
  std::set<std::int64_t> left = uncertified_set(result);
  for (const UnrepairableGroup& group : result.unrepairable)
    if (group.kind == UnrepairableGroup::Kind::FoldedFace)
      for (const std::int64_t element : group.elements) left.erase(element);
  const Cells cells(result.mesh, result.mesh.dimension);
  for (std::size_t c = 0; c < cells.count(); ++c)
    if (cells.shape(c) != Shape::Tetrahedron) left.erase(cells.number(c));
  return {left.begin(), left.end()};
}

/// Splits and optimises in rounds. Each round begins with the nodes where they were in `mesh`. `unsplit` is the mesh
/// optimised without a split. Returns the best result; nothing if there was nothing to split, or if the sequence was
/// stopped before the first run.
std::optional<Result> optimise_in_rounds(const HighOrderMesh& mesh, const Result& unsplit, const Options& options,
                                         RunSequence& runs) {
  HighOrderMesh start = mesh;
  std::vector<RepairStep> steps;
  std::optional<Result> best;
  std::vector<std::int64_t> wanted = worth_a_split(unsplit);
  std::size_t fewest = 0;  // tetrahedra left that are worth a split
  std::vector<CellCorner> marked;
  for (int round = 0; round < kMostRounds && !wanted.empty() && runs.may_go_on(); ++round) {
    const std::size_t had = steps.size();
    start = split_in_passes(std::move(start), options, std::move(wanted), std::move(marked), steps, runs.token());
    if (steps.size() == had || runs.stopped()) break;
    std::optional<Result> result = runs.run(start);
    if (!result) break;
    wanted = worth_a_split(*result);
    marked = bad_corners(*result, wanted);
    result->repairs = steps;
    result->notes.clear();  // even if the last run moved nothing, the splits did
    const bool gains = !best || wanted.size() < fewest;
    fewest = gains ? wanted.size() : fewest;
    if (!best || is_better(*result, *best)) best = std::move(result);
    if (!gains) break;
  }
  return best;
}

RepairStep left_unsplit(const Result& split, const Result& unsplit) {
  RepairStep step;
  step.sentence = "The mesh was left unsplit: with " + std::to_string(split.repairs.size()) + " splits, " +
                  std::to_string(split.after.uncertified.size()) +
                  " elements would not be certified valid; without them, " +
                  std::to_string(unsplit.after.uncertified.size()) + " are not.";
  return step;
}

/// Adds steps about the uncertified elements that splitting is not offered for, or for which it found nothing to split.
/// If the run was stopped, adds one that says so.
void say_what_is_left(Result& result, bool stopped) {
  if (stopped) {
    if (result.after.uncertified.empty()) return;
    RepairStep step;
    step.sentence = "The run was stopped before it had tried everything; run it again with more time.";
    result.repairs.push_back(std::move(step));
    return;
  }
  const Cells cells(result.mesh, result.mesh.dimension);
  const std::set<std::int64_t> uncertified = uncertified_set(result);
  RepairStep other, nothing;
  for (std::size_t c = 0; c < cells.count() && !uncertified.empty(); ++c) {
    if (!uncertified.contains(cells.number(c))) continue;
    (cells.shape(c) == Shape::Tetrahedron ? nothing : other).elements.push_back(cells.number(c));
  }
  if (!other.elements.empty()) {
    other.sentence = "Only tetrahedra can be split: " + elements_text(other.elements, "element", "elements") +
                     " stay as the optimisation left them.";
    result.repairs.push_back(std::move(other));
  }
  if (!nothing.elements.empty()) {
    nothing.sentence = "No interior edge or face could be split to help " +
                       elements_text(nothing.elements, "tetrahedron", "tetrahedra") +
                       ": a boundary face folds over itself, or the edges and faces in question are fixed or flat.";
    result.repairs.push_back(std::move(nothing));
  }
}

/// The quality of the mesh as it came. The token may stop the run meanwhile.
QualityReport quality_before(const HighOrderMesh& mesh, const Options& options, StopToken& stop) {
  Team team(options.threads);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  Grace grace(team, stop, certifier.cells());
  grace.watch();
  grace.finish([&] { team.run([&] { certifier.certify(mesh.coordinates, certificates, team); }); }, [] {});
  return report_quality(mesh, certifier, certificates, team, grace);
}

/// The result of a run that was stopped before it had another.
Result as_it_came(const HighOrderMesh& mesh, const MeshSummary& summary, const QualityReport& before,
                  const StopToken& stop) {
  Result result;
  result.mesh = mesh;
  result.sizes = summary;
  result.after = before;
  result.stop_reason = stop.reason() == StopToken::Reason::TimeLimit ? StopReason::TimeLimit : StopReason::Stopped;
  return result;
}

}  // namespace

Result optimise_by_splitting(const HighOrderMesh& mesh, const MeshSummary& summary, const Options& options,
                             const OnIteration& on_iteration, const RunControl& control, StopToken& stop) {
  RunSequence runs(options, on_iteration, control, stop);
  QualityReport before = quality_before(mesh, options, stop);
  std::optional<Result> best;
  if (!runs.stopped()) best = before.uncertified.empty() ? runs.run(mesh) : runs.run_briefly(mesh);
  if (!best) best = as_it_came(mesh, summary, before, stop);
  // The brief run may have ended before the optimum. If it left nothing to split, the run goes on as one without
  // splits.
  if (best->after.uncertified.empty() && best->stop_reason == StopReason::Iterations && runs.may_go_on()) {
    std::optional<Result> whole = runs.run(mesh);
    if (whole && whole->after.uncertified.empty()) best = std::move(whole);
  }
  if (!best->after.uncertified.empty() && runs.may_go_on()) {
    runs.allow(std::max(kLeastIterations, kTimesTheIterations * best->iterations));
    std::optional<Result> split = optimise_in_rounds(mesh, *best, options, runs);
    runs.allow_all();
    if (!split || !split->after.uncertified.empty()) {
      std::optional<Result> unsplit = runs.may_go_on() ? runs.run(mesh) : std::nullopt;
      if (unsplit && is_better(*unsplit, *best)) best = std::move(unsplit);
    }
    if (split && split->after.uncertified.size() < best->after.uncertified.size())
      best = std::move(split);
    else if (split && !runs.stopped())
      best->repairs.push_back(left_unsplit(*split, *best));
  }
  best->before = std::move(before);
  say_what_is_left(*best, runs.stopped());
  runs.finish(*best);
  return std::move(*best);
}

}  // namespace varimesh
