// A run from mesh to result: certificates, diagnosis, quality before, the stages, straightening, quality after.
#include "core/optimise/optimiser.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>

#include "core/accuracy/accuracy.h"
#include "core/base/index.h"
#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnose.h"
#include "core/diagnosis/elements_text.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"
#include "core/mesh/check.h"
#include "core/mesh/node_parameters.h"
#include "core/mesh/straight_sides.h"
#include "core/optimise/continuation.h"
#include "core/optimise/grace.h"
#include "core/optimise/set_up.h"
#include "core/optimise/splitting/splitting.h"
#include "core/problem/fixed_nodes.h"
#include "core/quality/certified_quality.h"
#include "core/repair/straighten.h"
#include "core/solvers/maxmin/raise.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// Certifies the mesh. If a cell is not valid, finds what cannot be repaired; if all are, there is nothing to repair.
void prove(const SetUp& set_up, const Certifier& certifier, std::vector<Certificate>& certificates, const Team& team,
           Result& result) {
  team.run([&] {
    certifier.certify(set_up.mesh.coordinates, certificates, team);
    if (!are_valid(certificates)) result.unrepairable = diagnose(set_up.mesh, set_up.fixed, team);
  });
}

/// Runs all stages. If the checkpoint cannot be used, they start from the beginning.
void run_stages(SetUp& set_up, const Certifier& certifier, std::vector<Certificate>& certificates,
                const Stopwatch& watch, const OnIteration& on_iteration, const RunControl& control, Team& team,
                Grace& grace, Result& result, RaiseMemory& raised) {
  if (Continuation(set_up, certifier, watch, on_iteration, control, team, grace).run(certificates, result, raised))
    return;
  RunControl from_the_beginning = control;
  from_the_beginning.checkpoint = {};
  Continuation(set_up, certifier, watch, on_iteration, from_the_beginning, team, grace)
      .run(certificates, result, raised);
}

void straighten_result(const SetUp& set_up, const Certifier& certifier, std::vector<Certificate>& certificates,
                       const Team& team, Grace& grace, Result& result) {
  const auto straighten_all = [&] {
    team.run([&] {
      result.repairs = straighten(result.mesh, set_up.fixed, certifier, certificates, result.unrepairable, team);
    });
  };
  grace.finish(straighten_all, [&] {
    RepairStep left;
    left.sentence = "The run was stopped before it could make elements straight-sided; run it again with more time.";
    result.repairs.push_back(std::move(left));
  });
}

/// Raises the smallest scaled Jacobian around cells that the run leaves invalid, but for those that it has tried in
/// vain. If none is left, and with Objective::Accuracy, it raises those below Options::min_js too. That costs accuracy,
/// so it is not worth it in a mesh that misses the bound in any case, and a mesh that came in valid does not get a
/// higher loss by it.
void raise_low(const SetUp& set_up, const Certifier& certifier, std::vector<Certificate>& certificates,
               const Team& team, Grace& grace, Result& result, RaiseMemory& raised) {
  const Options& options = set_up.options;
  const bool is_for_accuracy = asked_by(options).what == Asked::What::Loss;
  const std::vector<char> hopeless = cells_beyond_repair(result.unrepairable, certificates.size());
  const std::vector<double> coordinates = result.mesh.coordinates;
  const std::vector<Certificate> before = certificates;
  RaiseOutcome outcome;
  const auto raise_to = [&](double aim) {
    const RaiseTask task{result.mesh, set_up.fixed, hopeless, certifier, aim};
    team.run([&] {
      forget_changed_cells(task, result.mesh.coordinates, certificates, team.without_stop(), raised);
      outcome = raise_low_cells(task, result.mesh.coordinates, certificates, team, &raised);
    });
  };
  if (!are_valid(certificates)) raise_to(0);
  const std::vector<std::int64_t> made_valid = std::move(outcome.made_valid);
  if (is_for_accuracy && !outcome.interrupted && are_valid(certificates)) raise_to(options.min_js);
  if (outcome.interrupted) grace.say_stopped(result);
  if (made_valid.empty() && outcome.raised.empty()) return;
  if (result.before.uncertified.empty() &&
      !keeps_loss({.loss = accuracy(result.mesh, team.threads()).loss}, merit_of(result.before))) {
    result.mesh.coordinates = coordinates;
    certificates = before;
    return;
  }
  if (!made_valid.empty())
    result.notes.push_back("At the end of the run, " + elements_text(made_valid, "element", "elements") +
                           (made_valid.size() == 1 ? " was" : " were") + " made valid in small patches.");
  if (!outcome.raised.empty())
    result.notes.push_back("At the end of the run, the scaled Jacobian of " +
                           elements_text(outcome.raised, "element", "elements") + " was raised in small patches.");
}

/// A copy of the mesh with other coordinates. Those of the mesh, its largest array, are not copied.
HighOrderMesh with_coordinates(HighOrderMesh& mesh, std::vector<double> coordinates) {
  std::vector<double> kept = std::move(mesh.coordinates);
  HighOrderMesh copy = mesh;
  mesh.coordinates = std::move(kept);
  copy.coordinates = std::move(coordinates);
  return copy;
}

/// By cell of the result: 1 if it came clockwise, or is a part of a cell that did.
std::vector<char> clockwise_in_result(const SetUp& set_up, const Result& result) {
  if (set_up.options.repair != Repair::Split) return set_up.clockwise;
  const std::vector<std::int64_t> numbers = detail::cell_numbers(set_up.mesh, set_up.clockwise);
  std::unordered_set<std::int64_t> came(numbers.begin(), numbers.end());
  for (const RepairStep& step : result.repairs)
    for (std::size_t part = 0; part < step.new_elements.size() && !step.elements.empty(); ++part)
      if (came.contains(step.elements[part * step.elements.size() / step.new_elements.size()]))
        came.insert(step.new_elements[part]);
  const Cells cells(result.mesh, result.mesh.dimension);
  std::vector<char> clockwise(cells.count());
  for (std::size_t cell = 0; cell < clockwise.size(); ++cell)
    clockwise[cell] = came.contains(cells.number(cell)) ? 1 : 0;
  return clockwise;
}

/// Reports the cells that came clockwise, and turns them back unless the options say otherwise.
void keep_orientation(const SetUp& set_up, Result& result) {
  if (set_up.clockwise.empty()) return;
  const HighOrderMesh& mesh = set_up.mesh;
  result.before.clockwise = detail::cell_numbers(mesh, set_up.clockwise);
  std::string& note =
      result.notes.emplace_back(clockwise_text(result.before.clockwise, set_up.clockwise.size(), mesh.dimension));
  const bool one = result.before.clockwise.size() == 1;
  if (set_up.options.orient) {
    note += one ? ". It is written counter-clockwise." : ". They are written counter-clockwise.";
    return;
  }
  note += one ? ". It is written as it came; the option orient turns it."
              : ". They are written as they came; the option orient turns them.";
  const std::vector<char> clockwise = clockwise_in_result(set_up, result);
  const Team team(set_up.options.threads);
  team.run([&] { detail::turn_cells(result.mesh, clockwise, team); });
  result.after.clockwise = detail::cell_numbers(result.mesh, clockwise);
}

/// Why nothing was moved, though the run was not stopped; empty if something may have been moved.
std::string why_unmoved(const SetUp& set_up, const Result& result, const Team& team) {
  const HighOrderMesh& mesh = set_up.mesh;
  const std::string curve = mesh.dimension == 3 ? "; 'varimesh curve IN --geometry MODEL --order N' curves a mesh" : "";
  if (set_up.summary.free_nodes == 0)
    return "No node is free, so nothing was moved: all lie on the boundary or are fixed by the options. 'varimesh "
           "optimise --order' gives elements inner nodes, and '--free' frees interfaces.";
  if (result.iterations == 0 && result.stop_reason == StopReason::Valid)
    return "Every element is certified valid already, so nothing was moved.";
  if (result.iterations == 0 && result.stop_reason == StopReason::Quality)
    return "Every element has the scaled Jacobian that until_js names already, so nothing was moved.";
  const bool is_for_accuracy = set_up.options.objective == Objective::Accuracy;
  const bool is_same = is_for_accuracy ? result.mesh.coordinates == mesh.coordinates : result.iterations == 1;
  if (!is_same || !result.converged || !result.before.uncertified.empty()) return "";
  bool straight = set_up.options.target == Target::StraightSided;
  team.run([&] { straight = straight && has_straight_sides(mesh, team.without_stop()); });
  if (straight)
    return "All elements have straight sides already, so nothing was moved" + curve +
           "; 'varimesh optimise --target ideal' makes their shapes more regular.";
  if (is_for_accuracy && result.iterations == 0)
    return "Curvature costs these elements next to nothing beside what their size costs, so nothing was moved.";
  if (is_for_accuracy)
    return "No mesh with a lower loss of accuracy was found whose smallest and mean scaled Jacobian are not both "
           "lower, so nothing was moved.";
  return "The mesh is at its optimum already: no node would move by more than the tolerance, so nothing was moved.";
}

/// The mesh as it came, and the note that says why.
void take_as_it_came(const SetUp& set_up, const std::string& why, Result& result) {
  result.mesh = set_up.mesh;
  result.after = result.before;
  if (!why.empty()) result.notes.push_back(why);
  if (set_up.summary.free_nodes > 0 || set_up.options.max_iterations == 0) return;
  result.converged = true;  // there is no free node that could be far from the optimum
  result.stop_reason = StopReason::Converged;
}

std::string pair_text(const QualityReport& report) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3g and %.3g", report.min_scaled_jacobian, report.mean_scaled_jacobian);
  return text;
}

/// With Objective::Accuracy, goes back to the mesh as it came if it was valid and the run ended where the energy had
/// raised its loss. The descent itself chooses by the loss.
void keep_the_more_accurate(Result& result, const SetUp& set_up) {
  if (result.history.back().phase == Phase::Accuracy) return;
  if (keeps_loss(merit_of(result.after), merit_of(result.before))) return;
  result.kept_as_it_came = "The mesh stays as it came: where the run ended, its loss of accuracy was not lower.";
  result.mesh.coordinates = set_up.mesh.coordinates;
  result.after = result.before;
}

/// Goes back to the mesh as it came if it was valid and better. With another target than the straight-sided shape the
/// caller asks for a change, which the scaled Jacobian does not judge.
void keep_the_better(const SetUp& set_up, const std::vector<Certificate>& certificates, const Team& team,
                     Result& result) {
  if (!result.before.uncertified.empty()) return;
  const bool is_for_accuracy = set_up.options.objective == Objective::Accuracy;
  if (is_for_accuracy && !result.history.empty()) keep_the_more_accurate(result, set_up);
  if (set_up.options.target != Target::StraightSided) return;
  QualityReport before = result.before;
  if (before.lattice_intervals != result.after.lattice_intervals)  // there was no time for the usual report
    before = quick_quality(set_up.mesh, certificates, team);
  if (!is_lower(merit_of(result.after), merit_of(before), is_for_accuracy ? threshold::kHigher : 0)) return;
  const bool is_optimum = result.converged && !is_for_accuracy;
  result.kept_as_it_came = "The mesh stays as it came: its smallest and its mean scaled Jacobian are " +
                           pair_text(before) + ", and " +
                           (is_optimum ? "at the energy's optimum" : "where the run ended") + " they would be " +
                           pair_text(result.after) + ".";
  if (set_up.options.objective != Objective::Worst)
    result.kept_as_it_came += " To raise the smallest, try --objective worst.";
  result.mesh.coordinates = set_up.mesh.coordinates;
  result.after = result.before;
}

/// With Objective::Accuracy: says that the smallest scaled Jacobian is below Options::min_js.
void note_missed_bound(const Options& options, Result& result) {
  const double lowest = result.after.min_scaled_jacobian;
  const Asked asked = asked_by(options);
  const bool missed = asked.what == Asked::What::Loss && result.after.uncertified.empty() && lowest < asked.bound;
  if (!missed) return;
  char text[160];
  std::snprintf(
      text, sizeof text,
      "The smallest scaled Jacobian is %.3g, below the %.3g of min_js: %s. To raise it, try --objective worst.", lowest,
      options.min_js,
      result.stop_reason == StopReason::Converged ? "no mesh on the way reached it" : "the run ended before");
  result.notes.emplace_back(text);
}

/// Whether a limit or the caller has ended the run.
bool was_cut_short(const RunSummary& result) {
  return result.stop_reason == StopReason::TimeLimit || result.stop_reason == StopReason::Iterations ||
         result.stop_reason == StopReason::Stopped;
}

Tried tried_by(const Options& options, const RunSummary& result) {
  Tried tried;
  const bool cannot_move = result.sizes.free_nodes == 0;  // so another run would move nothing either
  tried.movement = cannot_move || result.iterations > 0;
  tried.until_valid = cannot_move || options.until == Until::Valid;
  tried.split = options.repair == Repair::Split;
  tried.cut_short = was_cut_short(result);
  return tried;
}

/// Optimises the mesh of the set-up, in which no cell is clockwise, as it is.
Result run_stages_once(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop) {
  const Options& options = set_up.options;
  const Stopwatch watch = Stopwatch::started(std::exchange(set_up.seconds, 0));
  Team team(control.threads ? control.threads() : options.threads);
  std::optional<Certifier> shared_certifier;
  team.run([&] { shared_certifier.emplace(set_up.mesh, CertificateOptions{}, team); });
  const Certifier& certifier = *shared_certifier;
  std::vector<Certificate> certificates(certifier.cells());
  Grace grace(team, stop, certifier.cells());
  if (control.checkpoint.empty()) grace.watch();
  Result result;
  const Stopwatch proof_watch;
  grace.finish([&] { prove(set_up, certifier, certificates, team, result); }, [] {});
  result.proof_seconds = proof_watch.seconds();
  result.sizes = set_up.summary;
  result.before = report_quality(set_up.mesh, certifier, certificates, team, grace);
  result.seconds = watch.seconds();
  const bool iterates = options.max_iterations > 0 && set_up.summary.free_nodes > 0 && !grace.stopped();
  RaiseMemory raised;
  if (iterates) run_stages(set_up, certifier, certificates, watch, on_iteration, control, team, grace, result, raised);
  const Stopwatch after_stages;
  const std::string unmoved = grace.stopped() ? "" : why_unmoved(set_up, result, team);
  if (!iterates || !unmoved.empty()) {
    take_as_it_came(set_up, unmoved, result);
    if (grace.stopped()) grace.say_stopped(result);
  } else {
    result.mesh = with_coordinates(set_up.mesh, std::move(result.mesh.coordinates));
    if (options.method == Method::Auto && control.untangles_lost && !was_cut_short(result))
      raise_low(set_up, certifier, certificates, team, grace, result, raised);
    if (options.repair == Repair::Straighten && !result.unrepairable.empty())
      straighten_result(set_up, certifier, certificates, team, grace, result);
    result.after = report_quality(result.mesh, certifier, certificates, team, grace);
    keep_the_better(set_up, certificates, team, result);
    result.seconds += after_stages.seconds();
  }
  return result;
}

/// The same, with splits if they were asked for. Says what is left.
Result run_turned(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop) {
  const Options& options = set_up.options;
  if (options.time_limit > 0) stop.stop_after(options.time_limit - set_up.seconds);
  const bool splits = options.repair == Repair::Split && options.max_iterations > 0;
  if (splits) set_up.seconds = 0;
  Result result = splits ? optimise_by_splitting(set_up, on_iteration, control, stop)
                         : run_stages_once(set_up, on_iteration, control, stop);
  const std::vector<std::int64_t> uncertified = uncertified_numbers(result.after);
  result.unrepairable = with_any_of(std::move(result.unrepairable), uncertified);
  result.left = what_is_left(result.mesh, uncertified, result.unrepairable, tried_by(options, result));
  note_missed_bound(options, result);
  return result;
}

Result run_once(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop) {
  Result result = run_turned(set_up, on_iteration, control, stop);
  keep_orientation(set_up, result);
  return result;
}

}  // namespace

Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration,
                          const RunControl& control) {
  StopToken stop(control.stop_asked);
  if (options.time_limit > 0) stop.stop_after(options.time_limit);
  // Before it is stopped, a run that goes on from a checkpoint must have the mesh that it had come to.
  const bool may_stop = control.checkpoint.empty();
  const NodesWithParameters with_parameters(mesh);
  const Expected<std::unique_ptr<SetUp>> prepared = set_up(std::move(mesh), options, may_stop ? &stop : nullptr);
  if (!prepared) return tl::unexpected(prepared.error());
  Result result = run_once(**prepared, on_iteration, control, stop);
  with_parameters.forget_moved(result.mesh);
  return result;
}

Expected<MeshSummary> summarise(const HighOrderMesh& mesh, const Options& options) {
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  const Team team(options.threads);
  Facets facet;
  Expected<void> checked;
  bool surface = false;
  team.run([&] {
    checked = check_judgeable(mesh, team, &facet);
    surface = checked && is_surface(mesh, team);
  });
  if (!checked) return tl::unexpected(checked.error());
  const Expected<std::vector<bool>> fixed =
      surface ? std::vector<bool>(mesh.node_count(), true) : choose_fixed_nodes(mesh, options, std::move(facet));
  if (!fixed) return tl::unexpected(fixed.error());
  MeshSummary summary;
  team.run([&] { summary = mesh_summary(mesh, *fixed, team); });
  return summary;
}

// ===== Optimiser =====

Optimiser::Optimiser(std::unique_ptr<SetUp> set_up) : set_up_(std::move(set_up)) {}
Optimiser::Optimiser(Optimiser&&) noexcept = default;
Optimiser& Optimiser::operator=(Optimiser&&) noexcept = default;
Optimiser::~Optimiser() = default;

Expected<Optimiser> Optimiser::create(const HighOrderMesh& mesh, const Options& options) {
  return create(HighOrderMesh(mesh), options);
}

Expected<Optimiser> Optimiser::create(HighOrderMesh&& mesh, const Options& options) {
  Expected<std::unique_ptr<SetUp>> prepared = set_up(std::move(mesh), options);
  if (!prepared) return tl::unexpected(prepared.error());
  return Optimiser(std::move(*prepared));
}

Expected<Result> Optimiser::run(std::vector<double> coordinates, const OnIteration& on_iteration,
                                const RunControl& control) {
  HighOrderMesh& mesh = set_up_->mesh;
  if (coordinates.size() != mesh.coordinates.size())
    return bad_input("There are " + std::to_string(coordinates.size()) + " coordinates; the mesh has " +
                     std::to_string(mesh.node_count()) + " nodes and needs " + std::to_string(mesh.coordinates.size()) +
                     ".");
  if (coordinates != mesh.coordinates) {
    mesh.coordinates.swap(coordinates);
    const Team team(set_up_->options.threads);
    Expected<void> checked;
    team.run([&] { checked = check_structure(mesh, team); });
    if (!checked) {
      mesh.coordinates.swap(coordinates);  // keeps the coordinates that were checked last
      return tl::unexpected(checked.error());
    }
  }
  StopToken stop(control.stop_asked);
  return run_once(*set_up_, on_iteration, control, stop);
}

}  // namespace varimesh
