// Looks, splits, optimises, looks again.
#include "core/optimise/splitting.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <functional>
#include <optional>
#include <set>

#include "core/base/index.h"
#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnose.h"
#include "core/mesh/connectivity.h"
#include "core/problem/fixed_nodes.h"
#include "core/reference/basis.h"
#include "core/repair/split.h"
#include "core/repair/weak_groups.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr double kLeastMargin = 0.08;
constexpr int kMostLooks = 4;
constexpr int kMostPasses = 8;

using Corners = std::vector<std::pair<std::int32_t, std::int32_t>>;  // cell, index of the vertex's node

/// Cells that have a folded boundary face.
std::vector<bool> folded_cells(const HighOrderMesh& mesh, const std::vector<bool>& fixed, std::size_t cells,
                               const Team& team) {
  std::vector<bool> folded(cells, false);
  for (const UnrepairableGroup& group : diagnose(mesh, fixed, team))
    if (group.kind == UnrepairableGroup::Kind::FoldedFace)
      for (const std::int32_t cell : group.cells) folded[at(cell)] = true;
  return folded;
}

/// Splits in passes until nothing is left that wants it, or it is asked to stop. `marked` are corners of the mesh as it
/// is handed in.
HighOrderMesh split_in_passes(HighOrderMesh mesh, const Options& options, Corners marked,
                              std::vector<RepairStep>& steps, const std::function<bool()>& stop_asked) {
  if (mesh.dimension != 3) return mesh;
  const Team team(options.threads);
  for (int pass = 0; pass < kMostPasses && !stop_asked(); ++pass) {
    const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
    if (!fixed) break;
    const Cells cells(mesh, mesh.dimension);
    const SplitRules rules(mesh, cells, *fixed);
    std::vector<SplitPlace> places;
    team.run([&] {
      std::vector<Certificate> certificates(cells.count());
      Certifier(mesh).certify(mesh.coordinates, certificates, team);
      if (stop_asked()) return;
      const std::vector<bool> folded = folded_cells(mesh, *fixed, cells.count(), team);
      WeakRule rule{kLeastMargin, std::vector<bool>(cells.count(), false), std::move(marked)};
      for (std::size_t c = 0; c < cells.count(); ++c) rule.wanted[c] = !folded[c] && !certificates[c].is_valid();
      std::ranges::sort(rule.marked);
      if (stop_asked()) return;
      places = choose_splits(weak_groups(mesh, *fixed, rules, rule, team), rules);
    });
    if (places.empty() || stop_asked()) break;
    marked.clear();
    mesh = split(mesh, places, steps);
  }
  return mesh;
}

/// Corners with J ≤ 0 of tetrahedra that are not certified in the optimised mesh; of one that has none, all.
Corners bad_corners(const Result& result) {
  const HighOrderMesh& mesh = result.mesh;
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  reference::Points vertices(4, 3);
  for (int v = 0; v < 4; ++v)
    for (int c = 0; c < 3; ++c) vertices(v, c) = reference::info(Shape::Tetrahedron).vertex[at(v)][at(c)];
  const auto gradients =
      reference::basis_gradients(Shape::Tetrahedron, mesh.order, reference::NodeSet::Equispaced, 3, vertices);
  std::set<std::int64_t> uncertified;
  for (const UncertifiedElement& element : result.after.uncertified) uncertified.insert(element.number);
  Corners result_corners;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    if (cells.shape(c) != Shape::Tetrahedron || !uncertified.contains(cells.number(c))) continue;
    const auto nodes = cells.nodes(c);
    Eigen::MatrixXd x(static_cast<Eigen::Index>(nodes.size()), 3);
    for (std::size_t n = 0; n < nodes.size(); ++n)
      for (int k = 0; k < 3; ++k) x(static_cast<Eigen::Index>(n), k) = mesh.coordinates[3 * at(nodes[n]) + at(k)];
    Corners bad;
    for (int v = 0; v < 4; ++v) {
      Eigen::Matrix3d jacobian;
      for (int k = 0; k < 3; ++k) jacobian.row(k) = gradients[at(k)].row(v) * x;
      if (!(sign * jacobian.determinant() > 0)) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    }
    if (bad.empty())
      for (int v = 0; v < 4; ++v) bad.emplace_back(static_cast<std::int32_t>(c), nodes[at(v)]);
    result_corners.insert(result_corners.end(), bad.begin(), bad.end());
  }
  return result_corners;
}

/// Runs one after another as if they were one.
class Runs {
 public:
  Runs(const Options& options, const OnIteration& on_iteration, const RunControl& control)
      : options_(options), on_iteration_(on_iteration) {
    control_.threads = control.threads;
    control_.stop_asked = control.stop_asked;
    options_.repair = Repair::Report;
    options_.order = 0;
  }

  /// Whether one more may be begun.
  bool may_go_on() const {
    return !stopped_ && static_cast<int>(history_.size()) < options_.max_iterations &&
           (options_.time_limit <= 0 || watch_.seconds() < options_.time_limit);
  }

  /// Whether somebody asked for the end, where there is no iteration that would say so.
  bool stop_asked() {
    stopped_ = stopped_ || (control_.stop_asked && control_.stop_asked());
    return stopped_;
  }

  /// Optimises the mesh, or judges it only. Nothing where the mesh is refused.
  std::optional<Result> run(const HighOrderMesh& mesh, bool judge_only = false) {
    Options options = options_;
    options.max_iterations = judge_only ? 0 : options_.max_iterations - static_cast<int>(history_.size());
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

  /// What is said of all of them together.
  void finish(Result& result) {
    result.history = std::move(history_);
    result.iterations = static_cast<int>(result.history.size());
    result.seconds = watch_.seconds();
    result.stopped = stopped_;
    if (stopped_) {
      result.stop_reason = StopReason::Stopped;
    } else if (!result.after.uncertified.empty()) {  // more would have been tried
      if (options_.time_limit > 0 && result.seconds >= options_.time_limit) result.stop_reason = StopReason::TimeLimit;
      if (result.iterations >= options_.max_iterations) result.stop_reason = StopReason::Iterations;
    }
  }

 private:
  Options options_;
  const OnIteration& on_iteration_;
  RunControl control_;
  Stopwatch watch_;
  std::vector<Iteration> history_;
  bool stopped_ = false;
};

/// Fewer uncertified elements; of as many, a higher minimum.
bool is_better(const Result& a, const Result& b) {
  const std::size_t left_a = a.after.uncertified.size(), left_b = b.after.uncertified.size();
  return left_a != left_b ? left_a < left_b : a.after.min_scaled_jacobian > b.after.min_scaled_jacobian;
}

std::string left_unsplit(std::size_t splits, std::size_t with, std::size_t without) {
  return "The mesh was left unsplit: with " + std::to_string(splits) + " splits " + std::to_string(with) +
         " elements would not be certified valid, without them " + std::to_string(without) + " are not.";
}

/// What splitting is not offered for, or found nothing to split for.
void say_what_is_left(Result& result) {
  const Cells cells(result.mesh, result.mesh.dimension);
  std::set<std::int64_t> uncertified;
  for (const UncertifiedElement& element : result.after.uncertified) uncertified.insert(element.number);
  RepairStep other, nothing;
  for (std::size_t c = 0; c < cells.count() && !uncertified.empty(); ++c) {
    if (!uncertified.contains(cells.number(c))) continue;
    (cells.shape(c) == Shape::Tetrahedron ? nothing : other).elements.push_back(cells.number(c));
  }
  if (!other.elements.empty()) {
    other.sentence =
        "Splitting is offered for tetrahedra alone: " + elements_text(other.elements, "element", "elements") +
        " stay as optimising left them.";
    result.repairs.push_back(std::move(other));
  }
  if (!nothing.elements.empty()) {
    nothing.sentence = "No interior edge or face may be split that would help " +
                       elements_text(nothing.elements, "tetrahedron", "tetrahedra") +
                       ": a boundary face folds, or what could be split is flat or fixed.";
    result.repairs.push_back(std::move(nothing));
  }
}

}  // namespace

Result optimise_by_splitting(const HighOrderMesh& mesh, const Options& options, const OnIteration& on_iteration,
                             const RunControl& control) {
  Runs runs(options, on_iteration, control);
  QualityReport before = quality(mesh, 0, options.threads);
  HighOrderMesh start = mesh;
  std::vector<RepairStep> steps;
  std::optional<Result> best;
  Corners marked;
  for (int look = 0; look < kMostLooks; ++look) {
    const std::size_t had = steps.size();
    if (!before.uncertified.empty())
      start = split_in_passes(std::move(start), options, std::move(marked), steps, [&] { return runs.stop_asked(); });
    if (steps.size() == had || runs.stop_asked()) break;  // nothing to split any more, or at all
    std::optional<Result> result = runs.run(start);
    if (!result) break;
    marked = bad_corners(*result);
    result->repairs = steps;
    if (!best || is_better(*result, *best)) best = std::move(result);
    if (best->after.uncertified.empty() || !runs.may_go_on()) break;
  }
  if (!best || !best->after.uncertified.empty()) {
    const bool judge_only = !runs.may_go_on();
    std::optional<Result> plain = runs.run(mesh, judge_only);
    // What was not optimised has to be better to be preferred.
    const std::size_t fewest = best ? best->after.uncertified.size() + (judge_only ? 0 : 1) : 0;
    if (!best || (plain && plain->after.uncertified.size() < fewest)) {
      if (best)
        plain->repairs.push_back(
            {RepairStep::Kind::Left,
             {},
             0,
             {},
             {},
             left_unsplit(best->repairs.size(), best->after.uncertified.size(), plain->after.uncertified.size())});
      best = std::move(plain);
    }
  }
  best->before = std::move(before);
  say_what_is_left(*best);
  runs.finish(*best);
  return std::move(*best);
}

}  // namespace varimesh
