#include "core/optimise/set_up.h"

#include <string>
#include <utility>

#include "core/base/stopwatch.h"
#include "core/diagnosis/elements_text.h"
#include "core/mesh/change_order.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/problem/fixed_nodes.h"
#include "core/problem/node_conversion.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int least = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= least) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(least) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
}

/// A mesh may be clockwise, but not a part of it.
Expected<void> check_senses(const HighOrderMesh& mesh) {
  const std::vector<char> against = detail::numbered_against_most(mesh);
  if (against.empty()) return {};
  const Cells cells(mesh, mesh.dimension);
  std::vector<std::int64_t> numbers;
  for (std::size_t cell = 0; cell < against.size(); ++cell)
    if (against[cell] != 0) numbers.push_back(cells.number(cell));
  return bad_input("The elements are not all numbered in the same sense: " +
                   elements_text(numbers, "element", "elements") + (numbers.size() == 1 ? " is" : " are") +
                   " numbered against the others. Number the vertices of all elements alike; in a Gmsh script, "
                   "ReverseMesh Surface{…} or Volume{…} turns the elements of an entity.");
}

}  // namespace

MeshSummary mesh_summary(const HighOrderMesh& mesh, const std::vector<bool>& fixed) {
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

Expected<std::unique_ptr<SetUp>> set_up(HighOrderMesh&& mesh, const Options& options, const StopToken* stop) {
  const Stopwatch watch;
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  if (const auto checked = check_structure(mesh); !checked) return tl::unexpected(checked.error());
  if (const auto checked = check_senses(mesh); !checked) return tl::unexpected(checked.error());
  if (!(frame_of(mesh).diagonal > 0))
    return bad_input("The mesh has no size: all its nodes are at one place. Write it again with its coordinates.");
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
  auto result = std::make_unique<SetUp>();
  result->options = options;
  result->summary = mesh_summary(mesh, *fixed);
  result->fixed = *fixed;
  result->target = std::move(*target);
  const auto iterates = [&] {
    return options.max_iterations > 0 && options.repair != Repair::Split && (stop == nullptr || !stop->stopped());
  };
  if (iterates()) result->problem = build_problem(mesh, *fixed, options.quadrature_degree);
  if (iterates()) result->coloured = colour_nodes(result->problem, options.colouring);
  if (iterates()) result->stages = make_stages(options, mesh.dimension);
  result->mesh = std::move(mesh);
  result->seconds = watch.seconds();
  return result;
}

}  // namespace varimesh
