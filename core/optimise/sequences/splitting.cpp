// Rounds of splitting and optimising; the best mesh is kept, and swapped if that was asked for.
#include "core/optimise/sequences/splitting.h"

#include <Eigen/LU>
#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/merit/merit.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/grace.h"
#include "core/optimise/sequences/raise_left.h"
#include "core/optimise/sequences/run_sequence.h"
#include "core/optimise/sequences/swap_left.h"
#include "core/optimise/sequences/work.h"
#include "core/reference/basis.h"
#include "core/repair/split_passes.h"
#include "core/solvers/checkpoint.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr int kMostRounds = 4;
/// The work of all rounds together, and of the run without a split that may follow them, as multiples of the work
/// before the first split.
constexpr double kTimesTheWork = 4;

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

/// Numbers of the elements with a folded boundary face.
std::set<std::int64_t> owners_of_folded_faces(const Result& result) {
  std::set<std::int64_t> owners;
  for (const UnrepairableGroup& group : result.unrepairable)
    if (group.kind == UnrepairableGroup::Kind::FoldedFace) owners.insert(group.elements.begin(), group.elements.end());
  return owners;
}

/// Numbers of uncertified tetrahedra that a split may help, in ascending order: those without a folded boundary face.
std::vector<std::int64_t> worth_a_split(const Result& result) {
  std::set<std::int64_t> left = uncertified_set(result);
  for (const std::int64_t owner : owners_of_folded_faces(result)) left.erase(owner);
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
    start = split_in_passes(std::move(start), options, std::move(wanted), std::move(marked), steps, runs.token(),
                            [&](std::size_t groups) { runs.note_groups(static_cast<std::int64_t>(groups)); });
    if (steps.size() == had || runs.stopped()) break;
    std::optional<Result> result = runs.run(start);
    if (!result) break;
    wanted = worth_a_split(*result);
    marked = bad_corners(*result, wanted);
    result->repairs = steps;
    result->notes.clear();  // even if the last run moved nothing, the splits did
    const bool gains = !best || wanted.size() < fewest;
    fewest = gains ? wanted.size() : fewest;
    if (!best || is_better(merit_of(result->after), merit_of(best->after), asked_by(options))) best = std::move(result);
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

RepairStep left_step(const std::vector<std::int64_t>& elements, const std::string& before, const std::string& after) {
  RepairStep step;
  step.elements = elements;
  step.sentence = before + elements_text(elements, "tetrahedron", "tetrahedra") + after;
  return step;
}

/// The elements that splits have cut.
std::set<std::int64_t> cut_elements(const std::vector<RepairStep>& steps) {
  std::set<std::int64_t> cut;
  for (const RepairStep& step : steps) {
    cut.insert(step.elements.begin(), step.elements.end());
    cut.insert(step.new_elements.begin(), step.new_elements.end());
  }
  return cut;
}

/// Adds a step for each reason why elements are left that are not certified valid; each of them is in exactly one. If
/// the run was stopped, adds one that says so instead. `out_of_work`: the rounds have used up what they may do.
void say_what_is_left(Result& result, Repair repair, bool stopped, bool out_of_work) {
  if (stopped) {
    if (result.after.uncertified.empty()) return;
    RepairStep step;
    step.sentence = "The run was stopped before it had tried everything; run it again with more time.";
    result.repairs.push_back(std::move(step));
    return;
  }
  const Cells cells(result.mesh, result.mesh.dimension);
  const std::set<std::int64_t> uncertified = uncertified_set(result);
  if (uncertified.empty()) return;
  const std::set<std::int64_t> folded = owners_of_folded_faces(result), cut = cut_elements(result.repairs);
  std::vector<std::int64_t> others, triangles, owners, in_vain, untouched;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    const std::int64_t number = cells.number(c);
    if (!uncertified.contains(number)) continue;
    const bool is_swapped = repair == Repair::Topology && cells.shape(c) == Shape::Triangle;
    std::vector<std::int64_t>& reason = is_swapped                             ? triangles
                                        : cells.shape(c) != Shape::Tetrahedron ? others
                                        : folded.contains(number)              ? owners
                                        : cut.contains(number)                 ? in_vain
                                                                               : untouched;
    reason.push_back(number);
  }
  std::vector<RepairStep>& steps = result.repairs;
  if (!others.empty()) {
    RepairStep step;
    step.elements = others;
    step.sentence = "Only tetrahedra can be split: " + elements_text(others, "element", "elements") +
                    (others.size() == 1 ? " stays" : " stay") + " as the optimisation left " +
                    (others.size() == 1 ? "it." : "them.");
    steps.push_back(std::move(step));
  }
  if (!triangles.empty()) {
    RepairStep step;
    step.elements = triangles;
    step.sentence = "No swap or collapse of an edge helped " + elements_text(triangles, "triangle", "triangles") +
                    ". A series of swaps and collapses might.";
    steps.push_back(std::move(step));
  }
  if (!owners.empty())
    steps.push_back(left_step(owners, "A boundary face folds over itself, so no split was tried for its own sake: ",
                              "; mesh the boundary anew there, or refine it."));
  const std::string ended = out_of_work ? " Splits have used up their share of the work." : "";
  if (!in_vain.empty())
    steps.push_back(left_step(in_vain, "Splits beside ", " were not enough. Other splits might be." + ended));
  if (!untouched.empty())
    steps.push_back(left_step(untouched, "No interior edge or face could be split to help ",
                              ": each one is fixed, flat, or has room already." + ended));
}

/// With Repair::Topology: changes how the elements around those that are left are connected, and optimises the mesh
/// from there. That may take as much work as all before. If the mesh is no better then, it is as it was.
void swap_and_optimise(Result& result, const Options& options, RunSequence& runs) {
  Result swapped = result;
  const auto note = [&](std::int64_t wanted) { runs.note_groups(wanted); };
  if (!swap_left(swapped, options, runs.token(), note)) return;
  const Asked asked = asked_by(options);
  runs.end_rounds(std::max(kLeastWork, runs.work()));
  if (runs.may_go_on()) {
    std::optional<Result> again = runs.run(swapped.mesh);
    if (again && is_better(merit_of(again->after), merit_of(swapped.after), asked)) {
      again->repairs = std::move(swapped.repairs);
      again->notes.clear();
      swapped = std::move(*again);
    }
  }
  if (is_better(merit_of(swapped.after), merit_of(result.after), asked)) result = std::move(swapped);
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

/// 0 if no checkpoint is read or written.
std::uint64_t fingerprint_for(const RunControl& control, const SetUp& set_up) {
  if (!control.checkpoint_due && control.checkpoint.empty()) return 0;
  return fingerprint(set_up.mesh, set_up.fixed, set_up.target, set_up.options);
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

Result optimise_by_splitting(const SetUp& set_up, const OnIteration& on_iteration, const RunControl& control,
                             StopToken& stop) {
  const HighOrderMesh& mesh = set_up.mesh;
  const Options& options = set_up.options;
  Options of_runs = options;  // they try other ways where a run that is not part of a sequence would
  of_runs.objective = set_up.given_objective;
  RunSequence runs(of_runs, fingerprint_for(control, set_up), on_iteration, control, stop);
  QualityReport before = quality_before(mesh, options, runs.token());
  std::optional<Result> best;
  bool out_of_work = false;
  if (!runs.stopped()) best = before.uncertified.empty() ? runs.run(mesh) : runs.run_briefly(mesh);
  if (!best) best = as_it_came(mesh, set_up.summary, before, stop);
  // The brief run may have ended before the optimum. If it left nothing to split, the run goes on as one without
  // splits.
  if (best->after.uncertified.empty() && best->stop_reason == StopReason::Iterations && runs.may_go_on()) {
    std::optional<Result> whole = runs.run(mesh);
    if (whole && whole->after.uncertified.empty()) best = std::move(whole);
  }
  if (!best->after.uncertified.empty() && runs.may_go_on()) {
    const double work = std::max(kLeastWork, kTimesTheWork * runs.work());
    runs.begin_rounds(work);
    std::optional<Result> split = optimise_in_rounds(mesh, *best, options, runs);
    const bool ran_out = runs.out_of_work();
    if (split && options.method == Method::Auto && !runs.stopped())
      if (const std::vector<std::int64_t> left = worth_a_split(*split); !left.empty())
        raise_left(*split, left, options, runs.token());
    runs.end_rounds(work);
    // If only owners of folded faces are left, another run would leave them too.
    if ((!split || !worth_a_split(*split).empty()) && runs.may_go_on()) {
      std::optional<Result> unsplit = runs.run(mesh);
      if (unsplit && is_better(merit_of(unsplit->after), merit_of(best->after), asked_by(options)))
        best = std::move(unsplit);
    }
    out_of_work = ran_out || runs.out_of_work();
    if (split && is_better(merit_of(split->after), merit_of(best->after)))  // a split must make more cells valid
      best = std::move(split);
    else if (split && !runs.stopped())
      best->repairs.push_back(left_unsplit(*split, *best));
  }
  if (options.repair == Repair::Topology && !runs.stopped()) swap_and_optimise(*best, options, runs);
  best->before = std::move(before);
  say_what_is_left(*best, options.repair, runs.stopped(), out_of_work);
  runs.finish(*best);
  return std::move(*best);
}

}  // namespace varimesh
