// Runs with and without splits: what they say about what is left, and the orientation of elements.
#include "core/optimise/optimiser.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/diagnosis/elements_text.h"
#include "core/forecast/forecast.h"
#include "core/merit/merit.h"
#include "core/mesh/check.h"
#include "core/mesh/checked_mesh.h"
#include "core/mesh/node_parameters.h"
#include "core/optimise/device/device_choice.h"
#include "core/optimise/run.h"
#include "core/optimise/sequences/attempts.h"
#include "core/optimise/sequences/control_of_ranks.h"
#include "core/optimise/sequences/splitting.h"
#include "core/optimise/set_up.h"
#include "core/problem/fixed_nodes.h"
#include "core/ranks/stop_together.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

/// By cell of the result: 1 if it came clockwise, or is a part of a cell that did.
std::vector<char> clockwise_in_result(const SetUp& set_up, const Result& result) {
  if (!splits(set_up.options.repair)) return set_up.clockwise;
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

/// With Objective::Accuracy: says that the smallest scaled Jacobian is below Options::min_js.
void note_missed_bound(const SetUp& set_up, Result& result) {
  const Options& options = set_up.options;
  const double lowest = result.after.min_scaled_jacobian;
  const Asked asked = asked_by(options);
  const bool missed = asked.what == Asked::What::Loss && result.after.uncertified.empty() && lowest < asked.bound;
  if (!missed) return;
  const bool is_spaced = options.layer_spacing != LayerSpacing::Keep && !set_up.layers.held.empty();
  char text[240];
  std::snprintf(text, sizeof text,
                "The smallest scaled Jacobian is %.3g, below the %.3g of min_js: %s. To raise it, %s.", lowest,
                options.min_js,
                is_spaced ? "the nodes in layers stay where layer_spacing has put them"
                : result.stop_reason == StopReason::Converged ? "no mesh on the way reached it"
                                                              : "the run ended before",
                is_spaced ? "keep the spacing of the layers" : "try the objective worst");
  result.notes.emplace_back(text);
}

Tried tried_by(const Options& options, const RunSummary& result, const OtherWays& others) {
  Tried tried;
  const bool cannot_move = result.sizes.free_nodes == 0;  // so another run would move nothing either
  tried.movement = cannot_move || result.iterations > 0;
  tried.until_valid = cannot_move || others.tried || options.until == Until::Valid;
  tried.split = splits(options.repair);
  tried.cut_short = was_cut_short(result);
  tried.next_order = result.sizes.order + 1;
  tried.left_at_next_order = others.left_at_next_order;
  return tried;
}

/// Optimises the mesh of the set-up, with splits if they were asked for. Says what is left.
Result optimise_set_up(SetUp& set_up, const OnIteration& tell, RunControl control, StopToken& stop) {
  const Options& options = set_up.options;
  Forecast forecast(Forecast::rules_of(options));
  control.forecast = &forecast;
  const OnIteration on_iteration = [&](Iteration iteration) {
    iteration.seconds_left = forecast.seconds_left(iteration.seconds).value_or(-1);
    if (control.meter != nullptr) control.meter->expect_end_in(iteration.seconds_left);
    return told_by_all(tell, iteration, control);
  };
  if (options.time_limit > 0) stop.stop_after(options.time_limit - set_up.seconds);
  std::optional<DeviceOfRun> device;
  if (!control.has_chosen_device) {
    device.emplace(options, set_up.summary.elements, control.open_device);
    control.device = &device->get();
    control.has_chosen_device = true;
  }
  const bool may_split = splits(options.repair) && options.max_iterations > 0;
  if (may_split) set_up.seconds = 0;
  Result result = may_split ? optimise_by_splitting(set_up, on_iteration, control, stop)
                            : Run(set_up, on_iteration, control, stop).go();
  const OtherWays others = try_other_ways(set_up, on_iteration, control, stop, result);
  const std::vector<std::int64_t> uncertified = uncertified_numbers(result.after);
  result.unrepairable = with_any_of(std::move(result.unrepairable), uncertified);
  result.left = what_is_left(result.mesh, uncertified, result.unrepairable, tried_by(options, result, others));
  if (device) device->tell(result.device, result.notes);
  note_missed_bound(set_up, result);
  keep_orientation(set_up, result);
  return result;
}

/// Puts a result that was made in a plane into space, with what it says about places.
void put_in_space(const Plane& plane, Result& result) {
  plane.put_back(result.mesh);
  const auto put = [&](auto& element) { element.place = plane.in_space(element.place[0], element.place[1]); };
  for (QualityReport* report : {&result.before, &result.after}) {
    std::ranges::for_each(report->invalid, put);
    std::ranges::for_each(report->uncertified, put);
  }
  char text[160];
  const auto [x, y, z] = plane.normal();
  std::snprintf(text, sizeof text,
                "The mesh lies in a plane with the normal (%.4g, %.4g, %.4g) and was optimised in it.", x, y, z);
  result.notes.emplace_back(text);
}

/// The sizes of a mesh that can be judged. A surface in space has no facets.
Expected<MeshSummary> summary_of(const HighOrderMesh& mesh, const Facets& facets, const Options& options) {
  const Team team(options.threads);
  const Expected<std::vector<bool>> fixed =
      facets.first.empty() ? std::vector<bool>(mesh.node_count(), true) : choose_fixed_nodes(mesh, options, facets);
  if (!fixed) return tl::unexpected(fixed.error());
  MeshSummary summary;
  team.run([&] { summary = mesh_summary(mesh, *fixed, team); });
  return summary;
}

}  // namespace

Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration,
                          const RunControl& control) {
  if (const auto right = check(options); !right) return tl::unexpected(right.error());
  auto passed = check_mesh(std::move(mesh), CheckFor::Optimising, Team(options.threads));
  if (!passed) return tl::unexpected(passed.error());
  return optimise(std::move(*passed), options, on_iteration, control);
}

Expected<Result> optimise(CheckedMesh mesh, const Options& given_options, const OnIteration& on_iteration,
                          const RunControl& given) {
  const Expected<RunControl> together = control_of_ranks(given, given_options);
  if (!together) return tl::unexpected(together.error());
  const RunControl& control = *together;
  Options options = given_options;
  // Whoever took from it what reading the mesh took has another one on each rank.
  if (options.time_limit > 0) options.time_limit = ranks_of(control).smallest(options.time_limit);
  StopToken stop(control.stop_asked);
  stop_together(stop, ranks_of(control));
  if (options.time_limit > 0) stop.stop_after(options.time_limit - mesh.seconds);
  // Before it is stopped, a run that goes on from a checkpoint must have the mesh that it had come to.
  const bool may_stop = control.checkpoint.empty();
  const std::optional<Plane> plane = std::exchange(mesh.plane, std::nullopt);
  const NodesWithParameters with_parameters(mesh.mesh);
  const Expected<std::unique_ptr<SetUp>> prepared = set_up(std::move(mesh), options, may_stop ? &stop : nullptr);
  if (!prepared) return tl::unexpected(prepared.error());
  RunControl in_plane = control;
  if (plane && control.show_mesh)
    in_plane.show_mesh = [&](const MeshOnTheWay& shown) {
      plane->put_back(shown.mesh);
      control.show_mesh(shown);
    };
  Result result = optimise_set_up(**prepared, on_iteration, in_plane, stop);
  with_parameters.forget_moved(result.mesh);
  if (plane) put_in_space(*plane, result);
  return result;
}

Expected<MeshSummary> summarise(const HighOrderMesh& mesh, const Options& options) {
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  const Team team(options.threads);
  Facets facets;
  Expected<void> checked;
  team.run([&] { checked = check_judgeable(mesh, team, &facets); });
  if (!checked) return tl::unexpected(checked.error());
  return summary_of(mesh, facets, options);
}

Expected<MeshSummary> summarise(const CheckedMesh& of, const Options& options) {
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  return summary_of(of.mesh, of.facets, options);
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
                                const RunControl& given) {
  const Expected<RunControl> together = control_of_ranks(given, set_up_->options);
  if (!together) return tl::unexpected(together.error());
  const RunControl& control = *together;
  if ((set_up_->layers.cells > 0 || set_up_->is_spent) && coordinates.size() == set_up_->mesh.coordinates.size()) {
    // Layers were found in other coordinates, or are no longer as they came; or the tables were freed.
    HighOrderMesh again = set_up_->mesh;
    again.coordinates = std::move(coordinates);
    Expected<std::unique_ptr<SetUp>> prepared = set_up(std::move(again), set_up_->options);
    if (!prepared) return tl::unexpected(prepared.error());
    (*prepared)->given_objective = set_up_->given_objective;
    (*prepared)->may_try_other_ways = set_up_->may_try_other_ways;
    (*prepared)->clockwise = std::move(set_up_->clockwise);  // the cells of this copy were turned already
    set_up_ = std::move(*prepared);
    StopToken stop(control.stop_asked);
    stop_together(stop, ranks_of(control));
    return optimise_set_up(*set_up_, on_iteration, control, stop);
  }
  HighOrderMesh& mesh = set_up_->mesh;
  if (coordinates.size() != mesh.coordinates.size())
    return bad_input("There are " + std::to_string(coordinates.size()) + " coordinates; the mesh has " +
                     std::to_string(mesh.node_count()) + " nodes and needs " + std::to_string(mesh.coordinates.size()) +
                     ".");
  if (coordinates != mesh.coordinates) {
    mesh.coordinates.swap(coordinates);
    const Team team(set_up_->options.threads);
    Expected<void> checked;
    team.run([&] { checked = check_places(mesh, team); });
    if (!checked) {
      mesh.coordinates.swap(coordinates);  // keeps the coordinates that were checked last
      return tl::unexpected(checked.error());
    }
  }
  StopToken stop(control.stop_asked);
  stop_together(stop, ranks_of(control));
  return optimise_set_up(*set_up_, on_iteration, control, stop);
}

}  // namespace varimesh
