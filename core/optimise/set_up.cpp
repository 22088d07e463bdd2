#include "core/optimise/set_up.h"

#include <atomic>
#include <optional>
#include <string>
#include <utility>

#include "core/base/index.h"
#include "core/base/stopwatch.h"
#include "core/diagnosis/elements_text.h"
#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "core/problem/fixed_nodes.h"
#include "core/problem/node_conversion.h"
#include "core/problem/substitute_shapes.h"
#include "core/problem/targets.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

constexpr std::size_t kIndicesPerTask = 65536;

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int least = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= least) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(least) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
}

/// Turns cells that are numbered clockwise. The facets of such a cell then have another order.
std::vector<char> turn_clockwise(CheckedMesh& of, const Team& team) {
  std::vector<char> clockwise = detail::clockwise_cells(of.mesh, of.facets, team);
  if (clockwise.empty()) return clockwise;
  detail::turn_cells(of.mesh, clockwise, team);
  of.facets = {};  // so that two tables are not in memory at the same time
  of.facets = facets(of.mesh, team);
  return clockwise;
}

/// Turns clockwise cells, and changes the order if the options name one, which leaves the facets as they are.
/// `clockwise` receives the cells that were turned. Inside team.run().
Expected<void> prepare(CheckedMesh& of, const Options& options, const Team& team, std::vector<char>& clockwise) {
  HighOrderMesh& mesh = of.mesh;
  clockwise = turn_clockwise(of, team);
  if (!(frame_of(mesh, team).diagonal > 0))
    return bad_input("The mesh has no size: all its nodes are at one place. Write it again with its coordinates.");
  if (options.order == 0 || options.order == mesh.order) return {};
  Expected<HighOrderMesh> changed = change_order(mesh, options.order);
  if (!changed) return tl::unexpected(changed.error());
  mesh = std::move(*changed);
  return {};
}

/// Brings layers into form, and fixes their nodes (core/layers/layers.h), if the objective is accuracy and the elements
/// aim at their straight-sided shapes. A mesh that came in valid keeps its nodes if the spacing is kept.
void start_with_layers(SetUp& set_up, const Team& team) {
  const Options& options = set_up.options;
  const bool is_wanted = options.objective == Objective::Accuracy && options.target == Target::StraightSided &&
                         options.method == Method::Auto && options.max_iterations > 0 && !splits(options.repair);
  if (!is_wanted) return;
  const bool names_fixed_nodes = !options.fix.empty() || !options.fix_nodes.empty() || options.region_below > 0;
  team.run([&] {
    set_up.layers = start_layers(set_up.mesh, set_up.facets, set_up.fixed, options.layer_spacing,
                                 names_fixed_nodes ? OnFlatSides::Stay : OnFlatSides::Slide, team);
  });
  if (!set_up.layers.coordinates.empty()) {
    set_up.as_it_came = std::move(set_up.mesh.coordinates);
    set_up.mesh.coordinates = std::move(set_up.layers.coordinates);
  }
  for (std::size_t node = 0; node < set_up.layers.held.size(); ++node)
    if (set_up.layers.held[node] != 0) set_up.fixed[node] = true;
}

}  // namespace

MeshSummary mesh_summary(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team) {
  std::vector<char> used(mesh.node_count(), 0);
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      team.for_ranges(block.nodes.size(), kIndicesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k)
          std::atomic_ref(used[block.nodes[k]]).store(1, std::memory_order_relaxed);
      });
  MeshSummary summary;
  summary.dimension = mesh.dimension;
  summary.order = mesh.order;
  summary.elements = static_cast<std::int64_t>(mesh.element_count(mesh.dimension));
  summary.nodes = static_cast<std::int64_t>(mesh.node_count());
  std::atomic<std::int64_t> free_nodes{0};
  team.for_ranges(mesh.node_count(), kIndicesPerTask, [&](std::size_t begin, std::size_t end) {
    std::int64_t here = 0;
    for (std::size_t n = begin; n < end; ++n) here += used[n] != 0 && !fixed[n] ? 1 : 0;
    free_nodes += here;
  });
  summary.free_nodes = free_nodes;
  return summary;
}

Expected<std::unique_ptr<SetUp>> set_up(HighOrderMesh&& mesh, const Options& options, const StopToken* stop) {
  if (const auto right = check(options); !right) return tl::unexpected(right.error());
  auto passed = check_mesh(std::move(mesh), CheckFor::Optimising, Team(options.threads));
  if (!passed) return tl::unexpected(passed.error());
  if (passed->plane)
    return bad_input("The mesh lies in a plane that is not z = constant; give an Optimiser coordinates in the plane.");
  return set_up(std::move(*passed), options, stop);
}

Expected<std::unique_ptr<SetUp>> set_up(CheckedMesh&& of, const Options& given, const StopToken* stop) {
  const Stopwatch watch = Stopwatch::started(of.seconds);
  HighOrderMesh& mesh = of.mesh;
  Options options = given;
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  const Team team(options.threads);
  std::vector<char> clockwise;
  Expected<void> prepared;
  team.run([&] { prepared = prepare(of, options, team, clockwise); });
  if (!prepared) return tl::unexpected(prepared.error());
  options.objective = objective_of(options, mesh.order);
  // Outside team.run(), because a region by quality brings a team of its own.
  const Expected<std::vector<bool>> fixed = choose_fixed_nodes(mesh, options, of.facets);
  if (!fixed) return tl::unexpected(fixed.error());
  Expected<StretchField> target = resolve_target_field(mesh, options);
  if (!target) return tl::unexpected(target.error());
  if (const auto degree = check_degree(mesh, options.quadrature_degree); !degree) return tl::unexpected(degree.error());
  auto result = std::make_unique<SetUp>();
  result->options = options;
  result->given_objective = given.objective;
  result->may_try_other_ways = may_try_other_ways(given);
  result->clockwise = std::move(clockwise);
  result->fixed = *fixed;
  result->target = std::move(*target);
  team.run([&] { result->summary = mesh_summary(mesh, *fixed, team); });
  result->mesh = std::move(mesh);
  result->facets = std::move(of.facets);
  start_with_layers(*result, team);
  const auto iterates = [&] {
    return options.max_iterations > 0 && !splits(options.repair) && (stop == nullptr || !stop->stopped());
  };
  team.run([&] {
    if (iterates()) result->problem = build_problem(result->mesh, result->fixed, options.quadrature_degree, team);
    if (iterates()) result->coloured = colour_nodes(result->problem, options.colouring, team);
    if (iterates()) result->stages = make_stages(options, result->mesh.dimension);
  });
  result->seconds = watch.seconds();
  return result;
}

bool may_try_other_ways(const Options& options) {
  Options without_objective = options;
  without_objective.objective = Objective::Auto;
  without_objective.min_js = Options().min_js;
  constexpr int kCurved = 2;
  return options.objective != Objective::Energy && objective_of(without_objective, kCurved) == Objective::Accuracy &&
         options.method == Method::Auto && !splits(options.repair) && options.max_iterations > 0;
}

SubstituteTargets choose_targets(SetUp& set_up, const Certifier& certifier, const Frame& frame, const Team& team) {
  const HighOrderMesh& mesh = set_up.mesh;
  SubstituteShapes substitutes;
  team.run([&] {
    substitutes =
        substitute_shapes(mesh, set_up.facets, certifier.sound_with_straight_sides(mesh.coordinates, team), team);
    set_targets(set_up.problem, set_up.target, frame.diagonal, substitutes, team);
  });
  SubstituteTargets named;
  const Cells cells(mesh, mesh.dimension);
  for (const std::int32_t cell : substitutes.cells) named.elements.push_back(cells.number(at(cell)));
  if (named.elements.empty()) return named;
  const bool one = named.elements.size() == 1;
  named.sentence = "With straight sides, " + elements_text(named.elements, "element", "elements") +
                   (one ? " is" : " are") + " inverted or nearly flat. " +
                   (one ? "Its target is made from a regular shape with its"
                        : "Their targets are made from regular shapes with their") +
                   " volume.";
  return named;
}

}  // namespace varimesh
