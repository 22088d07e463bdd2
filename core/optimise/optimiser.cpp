#include "core/optimise/optimiser.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "core/energy/material.h"
#include "core/mesh/check.h"
#include "core/mesh/order.h"
#include "core/optimise/cells.h"
#include "core/optimise/door.h"
#include "core/optimise/fixing.h"
#include "core/optimise/guard.h"
#include "core/optimise/kernels.h"
#include "core/optimise/newton.h"
#include "core/optimise/phases.h"
#include "core/optimise/schedule.h"
#include "core/optimise/sweep.h"
#include "core/optimise/targets.h"
#include "core/optimise/untangle.h"
#include "core/team.h"

namespace varimesh {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Deformation gradients are updated by rank one as nodes move; every so many sweeps they are computed anew, so that
/// rounding does not add up.
constexpr int kSweepsBetweenRebuilds = 16;
constexpr int kSettledSweepsBetweenLooks = 4;

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int floor = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= floor) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(floor) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
}

/// With until_js: the best mesh seen, by its proved minimum of the scaled Jacobian; of no use to a mesh that has more
/// uncertified cells than another.
class BestSeen {
 public:
  explicit BestSeen(const Certifier& certifier) : certifier_(certifier) {}

  /// The proved minimum of the guard's kept state; keeps its coordinates where it is the best so far.
  double look(const Guard& guard, std::vector<double>& coordinates) {
    certificates_ = guard.certificates();
    const CertificateSummary summary = certifier_.sharpen(guard.coordinates(), certificates_);
    const std::int64_t uncertified = summary.invalid + summary.undecided;
    const double bound = summary.min_scaled_jacobian_lower_bound;
    if (uncertified < fewest_ || (uncertified == fewest_ && bound > highest_)) {
      highest_ = bound;
      fewest_ = uncertified;
      coordinates = guard.coordinates();
    }
    return bound;
  }

 private:
  const Certifier& certifier_;
  std::vector<Certificate> certificates_;
  double highest_ = -std::numeric_limits<double>::infinity();
  std::int64_t fewest_ = std::numeric_limits<std::int64_t>::max();
};

}  // namespace

/// Everything that is set up once for a mesh topology.
struct Optimiser::State {
  HighOrderMesh mesh;
  Options options;
  MeshSummary summary;
  std::vector<bool> fixed;
  StretchField target;
  Problem problem;
  Schedule schedule;
  std::unique_ptr<Kernels> kernels;
  std::unique_ptr<HessianKernels> hessian;  ///< Where the method needs it.
  double set_up_seconds = 0;                ///< Counted with the first run.

  /// Optimises `mesh` as it is.
  Result run(const OnIteration& on_iteration);
  void iterate(const Team& team, BestSeen& best, Guard& guard, const OnIteration& on_iteration, Clock::time_point start,
               Result& result);
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
  const Clock::time_point start = Clock::now();
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
  if (options.max_iterations > 0) {
    state->problem = build_problem(mesh, *fixed, options.quadrature_degree);
    state->schedule = make_schedule(state->problem, options.colouring);
    state->kernels = make_kernels(material(options), mesh.dimension);
    if (options.method != Method::Sweeps) state->hessian = make_hessian_kernels(material(options), mesh.dimension);
  }
  state->mesh = std::move(mesh);
  state->set_up_seconds = seconds_since(start);
  return Optimiser(std::move(state));
}

Expected<Result> Optimiser::run(std::vector<double> coordinates, const OnIteration& on_iteration) {
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
  return state.run(on_iteration);
}

Result Optimiser::State::run(const OnIteration& on_iteration) {
  // The set-up's time counts as the first run's.
  const Clock::time_point start =
      Clock::now() - std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(set_up_seconds));
  set_up_seconds = 0;
  const Team team(options.threads);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  Result result;
  team.run([&] {
    certifier.certify(mesh.coordinates, certificates, team);
    // Where every cell is valid there is nothing to repair.
    if (std::any_of(certificates.begin(), certificates.end(),
                    [](const Certificate& certificate) { return certificate.answer != Certificate::Answer::Valid; }))
      result.unrepairable = diagnose(mesh, fixed, team);
  });
  result.summary = summary;
  result.before = quality(mesh, certifier, certificates, 0, team);
  result.mesh = mesh;
  if (options.max_iterations == 0) {
    result.after = result.before;
  } else {
    const Frame frame = frame_of(mesh);
    problem.positions = positions_at_door(mesh, frame);
    set_targets(problem, target, frame.diagonal);
    team.run([&] {
      Guard guard(mesh, frame, problem, certifier, std::move(certificates), team);
      guard.condemn(result.unrepairable);
      BestSeen best(certifier);
      iterate(team, best, guard, on_iteration, start, result);
      guard.look();
      if (guard.lost() > 0 && result.converged) {
        result.converged = false;
        result.stop_reason = StopReason::NoProgress;
      }
      guard.settle();
      if (options.until_js > 0)
        best.look(guard, result.mesh.coordinates);
      else
        result.mesh.coordinates = guard.coordinates();
      certificates = guard.certificates();
    });
    if (options.until_js > 0) team.run([&] { certifier.certify(result.mesh.coordinates, certificates, team); });
    result.after = quality(result.mesh, certifier, std::move(certificates), 0, team);
  }
  result.unrepairable = with_any_of(std::move(result.unrepairable), uncertified_numbers(result.after));
  result.seconds = seconds_since(start);
  return result;
}

void Optimiser::State::iterate(const Team& team, BestSeen& best, Guard& guard, const OnIteration& on_iteration,
                               Clock::time_point start, Result& result) {
  const PNorm norm{options.p_norm};
  Sweeper sweeper(problem, schedule, *kernels, options.regularisation, norm,
                  options.active_set ? options.tolerance : -1, team);
  sweeper.rebuild();
  sweeper.scan();
  PhaseChooser chooser(options, guard.repairable());
  Stopper stopper(options);
  std::optional<Newton> newton;  // set up when it is first needed
  std::optional<Untangler> untangler;
  double first_gradient = 0;
  Iteration iteration;
  iteration.invalid_elements = guard.uncertified();
  iteration.repairable_elements = guard.repairable();
  double bound = options.until_js > 0 ? best.look(guard, result.mesh.coordinates) : 0;
  if (const auto reason = stopper.after(iteration, false, chooser.outlook(guard.unrepaired()), bound)) {
    result.stop_reason = *reason;
    return;
  }
  for (int number = 1;; ++number) {
    iteration.phase = chooser.phase();
    iteration.number = number;
    double gradient = 0;
    bool stuck = false, failed = false, whole = true;
    if (iteration.phase == Phase::Sweeps) {
      const SweepReport swept = sweeper.sweep();
      if (number % kSweepsBetweenRebuilds == 0) sweeper.rebuild();
      iteration.residual = swept.residual;
      iteration.active_nodes = swept.visited;
      iteration.products = 0;
      gradient = swept.gradient_norm;
      whole = swept.visited == summary.free_nodes;
    } else if (iteration.phase == Phase::Untangle) {
      if (!untangler) {
        untangler.emplace(problem, *kernels, guard, team);
        chooser.untangling_from(guard.unrepaired());
      }
      const UntangleReport untangled = untangler->step();
      iteration.residual = untangled.residual;
      iteration.active_nodes = untangled.active_nodes;
      iteration.products = 0;
      gradient = untangled.gradient_norm;
      whole = false;
    } else {
      if (!newton) newton.emplace(problem, *kernels, *hessian, norm, team);
      const NewtonReport stepped = newton->step();
      sweeper.changed();
      iteration.residual = stepped.residual;
      iteration.active_nodes = summary.free_nodes;
      iteration.products = stepped.products;
      gradient = stepped.gradient_norm;
      stuck = stepped.damping == 0;
      failed = stepped.failed;
    }
    // Sweeps over cells that are all valid hardly change what is proved; the end looks at all that has moved since.
    const bool settled = iteration.phase == Phase::Sweeps && guard.uncertified() == 0 && options.until_js <= 0;
    if (!settled || number % kSettledSweepsBetweenLooks == 0) guard.look();
    if (untangler) {
      untangler->judge();
      sweeper.changed();
      stuck = untangler->done();
      if (stuck) untangler.reset();
    }
    const ScanReport seen = sweeper.scan();
    if (number == 1) first_gradient = gradient;
    iteration.energy = seen.energy;
    iteration.relative_gradient = first_gradient > 0 ? gradient / first_gradient : 0;
    iteration.min_scaled_jacobian = seen.min_scaled_jacobian;
    iteration.invalid_elements = guard.uncertified();
    iteration.repairable_elements = guard.repairable();
    iteration.seconds = seconds_since(start);
    result.history.push_back(iteration);
    result.iterations = number;
    result.residual = iteration.residual;
    if (options.until_js > 0) bound = best.look(guard, result.mesh.coordinates);
    const bool small = !failed && iteration.residual <= options.tolerance;
    // That the nodes which are awake hardly move is no proof: all have to be asked.
    if (small && !whole) sweeper.wake();
    result.converged = small && whole;
    if (on_iteration && on_iteration(iteration) == Control::Stop) {
      result.stopped = true;
      result.stop_reason = StopReason::Stopped;
      return;
    }
    if (const auto reason = stopper.after(iteration, result.converged, chooser.outlook(guard.unrepaired()), bound)) {
      result.stop_reason = *reason;
      return;
    }
    if (!chooser.next(guard.repairable(), guard.unrepaired(), stuck || result.converged)) {
      result.stop_reason = StopReason::NoProgress;
      return;
    }
  }
}

Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration) {
  Expected<Optimiser> optimiser = Optimiser::create(std::move(mesh), options);
  if (!optimiser) return tl::unexpected(optimiser.error());
  return optimiser->state_->run(on_iteration);
}

}  // namespace varimesh
