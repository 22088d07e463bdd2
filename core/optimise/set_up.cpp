#include "core/optimise/set_up.h"

#include <string>
#include <utility>

#include "core/base/stopwatch.h"
#include "core/mesh/change_order.h"
#include "core/mesh/check.h"
#include "core/problem/fixed_nodes.h"
#include "core/problem/node_conversion.h"

namespace varimesh {
namespace {

Expected<void> check_degree(const HighOrderMesh& mesh, int degree) {
  const int least = 2 * (mesh.order - 1);
  if (degree == 0 || degree >= least) return {};
  return bad_option("quadrature_degree " + std::to_string(degree) + " is too low for a mesh of order " +
                    std::to_string(mesh.order) + ": below 2 (P − 1) = " + std::to_string(least) +
                    " the energy does not see all of an element; leave it at 0 for twice the order.");
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

Expected<std::unique_ptr<SetUp>> set_up(HighOrderMesh&& mesh, const Options& options) {
  const Stopwatch watch;
  if (const auto checked = check(options); !checked) return tl::unexpected(checked.error());
  if (const auto checked = check_structure(mesh); !checked) return tl::unexpected(checked.error());
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
  if (options.max_iterations > 0 && options.repair != Repair::Split) {
    result->problem = build_problem(mesh, *fixed, options.quadrature_degree);
    result->coloured = colour_nodes(result->problem, options.colouring);
    result->stages = make_stages(options, mesh.dimension);
  }
  result->mesh = std::move(mesh);
  result->seconds = watch.seconds();
  return result;
}

}  // namespace varimesh
