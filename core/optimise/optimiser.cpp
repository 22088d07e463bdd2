#include "core/optimise/optimiser.h"

#include <algorithm>
#include <optional>
#include <string>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnose.h"
#include "core/mesh/check.h"
#include "core/mesh/order.h"
#include "core/optimise/checkpoint.h"
#include "core/optimise/run.h"
#include "core/optimise/splitting.h"
#include "core/optimise/stages.h"
#include "core/problem/fixed_nodes.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/problem/targets.h"
#include "core/quality/certified_quality.h"
#include "core/repair/straighten.h"
#include "core/sweeps/colouring.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// What the mean scaled Jacobian may lose to its lowest.
constexpr double kMeanGivenForWorst = 0.01;

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int floor = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= floor) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(floor) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
}

}  // namespace

/// Everything that is set up once for a mesh topology.
struct Optimiser::State {
  HighOrderMesh mesh;
  Options options;
  MeshSummary summary;
  std::vector<bool> fixed;
  StretchField target;
  Problem problem;
  ColouredNodes coloured;
  std::vector<Stage> stages;
  double set_up_seconds = 0;  ///< Counted with the first run.

  /// Optimises `mesh` as it is.
  Result run(const OnIteration& on_iteration, const RunControl& control);
  /// What lies between the reports before and after. Of the result's mesh it sets the coordinates alone: the rest is
  /// copied when what the run needed has been given back.
  bool optimise(const Certifier& certifier, std::vector<Certificate>& certificates, const Stopwatch& watch,
                const OnIteration& on_iteration, const RunControl& control, Team& team, Result& result);
  HighOrderMesh with_coordinates(std::vector<double> coordinates) const;
  RunParts parts(const Stage& stage, Guard& guard, BestSeen& best, const Team& team);
  /// At the end of a stage: whether its mesh is the best so far, or the stage was broken off before it could be, which
  /// says nothing of the next.
  bool worst_may_rise(Guard& guard, BestSeen& best, bool first, StopReason ended, const Team& team) const;
  void iterate(Run& run, const Stage& stage, const OnIteration& on_iteration, const RunControl& control, Team& team,
               Result& result) const;
  std::uint64_t fingerprint_of_run(const RunControl& control, const Stage& stage) const;
};

namespace {

MeshSummary sizes(const HighOrderMesh& mesh, const std::vector<bool>& fixed) {
  std::vector<bool> used(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      for (const std::int32_t node : block.nodes) used[node] = true;
  MeshSummary summary;
  summary.dimension = mesh.dimension;
  summary.order = mesh.order;
  summary.elements = static_cast<std::int64_t>(mesh.element_count(mesh.dimension));
  summary.nodes = static_cast<std::int64_t>(mesh.node_count());
  for (std::size_t n = 0; n < mesh.node_count(); ++n) summary.free_nodes += used[n] && !fixed[n] ? 1 : 0;
  return summary;
}

}  // namespace

Expected<MeshSummary> summarise(const HighOrderMesh& mesh, const Options& options) {
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  if (const auto checked = check_to_judge(mesh); !checked) return tl::unexpected(checked.error());
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
  if (!fixed) return tl::unexpected(fixed.error());
  return sizes(mesh, *fixed);
}

Optimiser::Optimiser(std::unique_ptr<State> state) : state_(std::move(state)) {}
Optimiser::Optimiser(Optimiser&&) noexcept = default;
Optimiser& Optimiser::operator=(Optimiser&&) noexcept = default;
Optimiser::~Optimiser() = default;

Expected<Optimiser> Optimiser::create(const HighOrderMesh& mesh, const Options& options) {
  return create(HighOrderMesh(mesh), options);
}

Expected<Optimiser> Optimiser::create(HighOrderMesh&& mesh, const Options& options) {
  const Stopwatch watch;
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  if (const auto checked = check(mesh); !checked) return tl::unexpected(checked.error());
  if (options.order > 0 && options.order != mesh.order) {
    Expected<HighOrderMesh> changed = change_order(mesh, options.order);
    if (!changed) return tl::unexpected(changed.error());
    mesh = std::move(*changed);
  }
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options);
  if (!fixed) return tl::unexpected(fixed.error());
  Expected<StretchField> target = resolve_target_field(mesh, options);
  if (!target) return tl::unexpected(target.error());
  if (const auto checked = check_degree(mesh, options.quadrature_degree); !checked)
    return tl::unexpected(checked.error());
  auto state = std::make_unique<State>();
  state->options = options;
  state->summary = sizes(mesh, *fixed);
  state->fixed = *fixed;
  state->target = std::move(*target);
  if (options.max_iterations > 0 && options.repair != Repair::Split) {
    state->problem = build_problem(mesh, *fixed, options.quadrature_degree);
    state->coloured = colour_nodes(state->problem, options.colouring);
    state->stages = make_stages(options, mesh.dimension);
  }
  state->mesh = std::move(mesh);
  state->set_up_seconds = watch.seconds();
  return Optimiser(std::move(state));
}

Expected<Result> Optimiser::run(std::vector<double> coordinates, const OnIteration& on_iteration,
                                const RunControl& control) {
  State& state = *state_;
  if (coordinates.size() != state.mesh.coordinates.size())
    return bad_input("The coordinates are " + std::to_string(coordinates.size()) + " numbers; the mesh has " +
                     std::to_string(state.mesh.node_count()) + " nodes and so needs " +
                     std::to_string(state.mesh.coordinates.size()) + ".");
  if (coordinates != state.mesh.coordinates) {
    state.mesh.coordinates.swap(coordinates);
    if (const auto checked = check(state.mesh); !checked) {
      state.mesh.coordinates.swap(coordinates);  // what was checked last stays
      return tl::unexpected(checked.error());
    }
  }
  return state.run(on_iteration, control);
}

Result Optimiser::State::run(const OnIteration& on_iteration, const RunControl& control) {
  if (options.repair == Repair::Split && options.max_iterations > 0)
    return optimise_by_splitting(mesh, options, on_iteration, control);
  // The set-up's time counts as the first run's.
  const Stopwatch watch = Stopwatch::started(set_up_seconds);
  set_up_seconds = 0;
  Team team(control.threads ? control.threads() : options.threads);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  Result result;
  const Stopwatch proof;
  team.run([&] {
    certifier.certify(mesh.coordinates, certificates, team);
    // Where every cell is valid there is nothing to repair.
    if (std::any_of(certificates.begin(), certificates.end(),
                    [](const Certificate& certificate) { return !certificate.is_valid(); }))
      result.unrepairable = diagnose(mesh, fixed, team);
  });
  result.proof_seconds = proof.seconds();
  result.sizes = summary;
  result.before = quality(mesh, certifier, certificates, 0, team);
  result.seconds = watch.seconds();
  if (options.max_iterations == 0) {
    result.mesh = mesh;
    result.after = result.before;
  } else {
    if (!optimise(certifier, certificates, watch, on_iteration, control, team, result)) {
      RunControl from_the_beginning = control;
      from_the_beginning.checkpoint = {};
      optimise(certifier, certificates, watch, on_iteration, from_the_beginning, team, result);
    }
    const Stopwatch reporting;
    result.mesh = with_coordinates(std::move(result.mesh.coordinates));
    if (options.repair == Repair::Straighten)
      team.run(
          [&] { result.repairs = straighten(result.mesh, fixed, certifier, certificates, result.unrepairable, team); });
    result.after = quality(result.mesh, certifier, std::move(certificates), 0, team);
    result.seconds += reporting.seconds();
  }
  result.unrepairable = with_any_of(std::move(result.unrepairable), uncertified_numbers(result.after));
  return result;
}

bool Optimiser::State::optimise(const Certifier& certifier, std::vector<Certificate>& certificates,
                                const Stopwatch& watch, const OnIteration& on_iteration, const RunControl& control,
                                Team& team, Result& result) {
  const Frame frame = frame_of(mesh);
  std::optional<Guard> guard;
  std::optional<Run> run;
  std::optional<BestSeen> best;
  const auto set_up = [&](const Stage& stage) {
    guard.emplace(mesh, frame, problem, certifier, certificates, team);
    if (options.repair != Repair::None) guard->set_unrepairable(result.unrepairable);
    best.emplace(certifier);
    run.emplace(parts(stage, *guard, *best, team), watch);
  };
  problem.positions = solver_positions(mesh, frame);
  set_targets(problem, target, frame.diagonal);
  std::size_t stage = 0;
  std::optional<StopReason> nothing_to_do;
  if (control.checkpoint.empty()) {
    team.run([&] {
      set_up(stages[0]);
      nothing_to_do = run->begin();
    });
  } else {
    bool usable = false;
    for (stage = 0; stage < stages.size() && !usable; stage += usable ? 0 : 1)
      team.run([&] {
        problem.positions = solver_positions(mesh, frame);  // an attempt at reading spoils them
        if (stage > 0) level_targets(problem);
        set_up(stages[stage]);
        usable = run->resume(control.checkpoint, fingerprint_of_run(control, stages[stage]));
      });
    if (!usable) return false;
  }
  result.resumed_from = run->last().number;
  if (nothing_to_do)
    result.stop_reason = *nothing_to_do;
  else
    iterate(*run, stages[stage], on_iteration, control, team, result);
  while (stages.size() > 1 && worst_may_rise(*guard, *best, stage == 0, result.stop_reason, team) && !nothing_to_do &&
         (result.stop_reason == StopReason::Converged || result.stop_reason == StopReason::NoProgress) &&
         ++stage < stages.size()) {
    level_targets(problem);
    team.run([&] {
      Run::Past past = run->take_past();
      run.emplace(parts(stages[stage], *guard, *best, team), watch);
      run->follow(std::move(past));
      nothing_to_do = run->begin();
    });
    if (!nothing_to_do) iterate(*run, stages[stage], on_iteration, control, team, result);
  }
  const bool best_seen = options.until_js > 0 || stages.size() > 1;
  result.seconds = run->seconds();
  result.history = run->take_history();
  run.reset();  // and with it what Newton's method needed
  drop_deformation(problem);
  const Stopwatch after_run;
  team.run([&] {
    guard->certify_moved();
    if (guard->lost() > 0 && result.converged) {
      result.converged = false;
      result.stop_reason = StopReason::NoProgress;
    }
    guard->restore_lost();
    if (options.until_js > 0) best->consider(*guard);
    result.mesh.coordinates = best_seen ? best->coordinates() : guard->coordinates();
    certificates = guard->certificates();
    result.proof_seconds += guard->seconds();
    if (best_seen) certifier.certify(result.mesh.coordinates, certificates, team);
  });
  result.seconds += after_run.seconds();
  return true;
}

HighOrderMesh Optimiser::State::with_coordinates(std::vector<double> coordinates) const {
  HighOrderMesh moved = mesh;
  moved.coordinates = std::move(coordinates);
  return moved;
}

RunParts Optimiser::State::parts(const Stage& stage, Guard& guard, BestSeen& best, const Team& team) {
  return {stage.options, problem, coloured, *stage.kernels, stage.hessian.get(), guard, best, team};
}

bool Optimiser::State::worst_may_rise(Guard& guard, BestSeen& best, bool first, StopReason ended,
                                      const Team& team) const {
  team.run([&] {
    guard.certify_moved();
    guard.restore_lost();
  });
  const std::vector<double> scaled_jacobian =
      cell_quality(with_coordinates(guard.coordinates()), 0, options.threads).scaled_jacobian;
  double mean = 0;
  for (const double js : scaled_jacobian) mean += std::max(js, -1.0) / static_cast<double>(scaled_jacobian.size());
  if (first) best.floor = mean - kMeanGivenForWorst;
  if (mean < best.floor) return false;
  const double before = best.highest();
  team.run([&] { best.consider(guard); });
  return best.highest() > before || ended == StopReason::NoProgress;
}

void Optimiser::State::iterate(Run& run, const Stage& stage, const OnIteration& on_iteration, const RunControl& control,
                               Team& team, Result& result) const {
  const std::uint64_t print = fingerprint_of_run(control, stage);
  bool stopped = false;
  std::optional<StopReason> reason;
  while (!stopped && !reason) {
    if (control.threads) team.set_threads(control.threads());
    team.run([&] { reason = run.step(); });
    const Iteration& last = run.last();
    if (!reason && control.checkpoint_due && run.can_be_kept() && control.checkpoint_due(last))
      control.save_checkpoint(last, [&](const CheckpointSink& sink) { return run.write(sink, print); });
    stopped = on_iteration && on_iteration(last) == Control::Stop;
  }
  result.iterations = run.last().number;
  result.residual = run.last().residual;
  result.converged = run.converged();
  result.stopped = stopped;
  result.stop_reason = stopped ? StopReason::Stopped : *reason;
}

std::uint64_t Optimiser::State::fingerprint_of_run(const RunControl& control, const Stage& stage) const {
  return control.checkpoint_due || !control.checkpoint.empty() ? fingerprint(mesh, fixed, target, stage.options) : 0;
}

Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration,
                          const RunControl& control) {
  Expected<Optimiser> optimiser = Optimiser::create(std::move(mesh), options);
  if (!optimiser) return tl::unexpected(optimiser.error());
  return optimiser->state_->run(on_iteration, control);
}

}  // namespace varimesh
