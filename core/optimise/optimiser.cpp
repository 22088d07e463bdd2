#include "core/optimise/optimiser.h"

#include <chrono>
#include <cmath>
#include <optional>
#include <string>

#include "core/energy/material.h"
#include "core/mesh/check.h"
#include "core/mesh/order.h"
#include "core/optimise/cells.h"
#include "core/optimise/door.h"
#include "core/optimise/fixing.h"
#include "core/optimise/kernels.h"
#include "core/optimise/newton.h"
#include "core/optimise/schedule.h"
#include "core/optimise/sweep.h"
#include "core/optimise/targets.h"
#include "core/team.h"

namespace varimesh {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Deformation gradients are updated by rank one as nodes move; every so many sweeps they are computed anew, so that
/// rounding does not add up.
constexpr int kSweepsBetweenRebuilds = 16;

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int floor = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= floor) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(floor) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
}

/// Which phase comes next. Method::Auto sweeps until every cell is valid, or until so many sweeps brought no fewer
/// invalid cells, and goes on with Newton; where a Newton step finds no lower energy, a few sweeps get it off the spot.
class PhaseChooser {
 public:
  PhaseChooser(Method method, std::int64_t invalid) : method_(method), fewest_invalid_(invalid) {
    newton_ = method == Method::Newton || (method == Method::Auto && invalid == 0);
  }

  Phase phase() const { return newton_ ? Phase::Newton : Phase::Sweeps; }

  /// After an iteration: false where nothing is left to try.
  bool next(std::int64_t invalid, bool stuck) {
    if (method_ == Method::Sweeps) return true;
    if (newton_ && stuck) {
      if (method_ == Method::Newton || ++times_stuck_ > kMostTimesStuck) return false;
      newton_ = false;
      patience_ = kSweepsWhenStuck;
      return true;
    }
    if (newton_) return true;
    if (invalid < fewest_invalid_) {
      fewest_invalid_ = invalid;
      patience_ = std::max(patience_, kPatience);
    }
    newton_ = (invalid == 0 && times_stuck_ == 0) || --patience_ <= 0;
    return true;
  }

 private:
  static constexpr int kPatience = 10;  // sweeps without fewer invalid cells
  static constexpr int kSweepsWhenStuck = 5;
  static constexpr int kMostTimesStuck = 3;

  Method method_;
  std::int64_t fewest_invalid_;
  bool newton_ = false;
  int patience_ = kPatience;
  int times_stuck_ = 0;
};

}  // namespace

/// Everything that is set up once for a mesh topology.
struct Optimiser::State {
  HighOrderMesh mesh;
  Options options;
  MeshSummary summary;
  StretchField target;
  Problem problem;
  Schedule schedule;
  std::unique_ptr<Kernels> kernels;
  std::unique_ptr<HessianKernels> hessian;  ///< Where the method needs it.
  double set_up_seconds = 0;                ///< Counted with the first run.

  /// Optimises `mesh` as it is.
  Result run(const OnIteration& on_iteration);
  void iterate(Team& team, const OnIteration& on_iteration, Clock::time_point start, Result& result);
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
  if (const auto checked = check(mesh); !checked) return tl::unexpected(checked.error());
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
  Result result;
  result.summary = summary;
  result.before = quality(mesh, 0, options.threads);
  result.mesh = mesh;
  if (options.max_iterations == 0) {
    result.after = result.before;
  } else {
    const Frame frame = frame_of(mesh);
    problem.positions = positions_at_door(mesh, frame);
    const std::vector<double> before = problem.positions;
    set_targets(problem, mesh, target, frame.diagonal);
    Team team(options.threads);
    team.run([&] { iterate(team, on_iteration, start, result); });
    result.mesh.coordinates = coordinates_at_door(mesh, frame, before, problem.positions);
    result.after = quality(result.mesh, 0, options.threads);
  }
  result.seconds = seconds_since(start);
  return result;
}

void Optimiser::State::iterate(Team& team, const OnIteration& on_iteration, Clock::time_point start, Result& result) {
  const PNorm norm{options.p_norm};
  Sweeper sweeper(problem, schedule, *kernels, options.regularisation, norm, team);
  sweeper.rebuild();
  PhaseChooser chooser(options.method, sweeper.scan().invalid);
  std::optional<Newton> newton;  // set up when it is first needed
  double first_gradient = 0;
  for (int number = 1; number <= options.max_iterations; ++number) {
    Iteration iteration;
    iteration.phase = chooser.phase();
    iteration.number = number;
    double gradient = 0;
    bool stuck = false, failed = false;
    if (iteration.phase == Phase::Sweeps) {
      const SweepReport swept = sweeper.sweep();
      if (number % kSweepsBetweenRebuilds == 0) sweeper.rebuild();
      iteration.residual = swept.residual;
      iteration.active_nodes = swept.visited;
      gradient = swept.gradient_norm;
    } else {
      if (!newton) newton.emplace(problem, *kernels, *hessian, norm, team);
      const NewtonReport stepped = newton->step();
      iteration.residual = stepped.residual;
      iteration.active_nodes = summary.free_nodes;
      gradient = stepped.gradient_norm;
      stuck = stepped.damping == 0;
      failed = stepped.failed;
    }
    const ScanReport seen = sweeper.scan();
    if (number == 1) first_gradient = gradient;
    iteration.energy = seen.energy;
    iteration.relative_gradient = first_gradient > 0 ? gradient / first_gradient : 0;
    iteration.min_scaled_jacobian = seen.min_scaled_jacobian;
    iteration.invalid_elements = seen.invalid;
    iteration.seconds = seconds_since(start);
    result.history.push_back(iteration);
    result.iterations = number;
    result.residual = iteration.residual;
    result.converged = !failed && iteration.residual <= options.tolerance;
    if (on_iteration && on_iteration(iteration) == Control::Stop) {
      result.stopped = true;
      return;
    }
    if (result.converged || !chooser.next(seen.invalid, stuck)) return;
  }
}

Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration) {
  Expected<Optimiser> optimiser = Optimiser::create(std::move(mesh), options);
  if (!optimiser) return tl::unexpected(optimiser.error());
  return optimiser->state_->run(on_iteration);
}

}  // namespace varimesh
