#include "core/optimise/on_geometry/refine_on_model.h"

#include <utility>

#include "core/association/association.h"
#include "core/association/plane/profile.h"
#include "core/base/team.h"
#include "core/mesh/node_parameters.h"
#include "core/mesh/plane.h"
#include "core/repair/refine.h"
#include "core/slide/slide_on_file.h"

namespace varimesh {

Expected<std::size_t> refine_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                      const geometry::Geometry& model, const std::vector<std::int64_t>& wanted,
                                      std::size_t most_cells, Refinement& done) {
  auto held = nodes_of_groups(mesh, options.fix);
  if (!held) return tl::unexpected(held.error());
  Team team(options.threads);
  team.set_stop(options.stop);
  Expected<Association> association;
  HighOrderMesh refined = mesh;
  const NodesWithParameters before(mesh);
  RefineReport report;
  team.run([&] {
    association = lies_in_a_plane(mesh, team) ? associate_in_plane(mesh, model, team) : associate(mesh, model, team);
    if (association) report = refine(refined, *association, {wanted, most_cells, std::move(*held)}, done.steps, team);
  });
  if (!association) return tl::unexpected(association.error());
  done.is_full = report.is_full;
  if (report.edges == 0) return report.edges;
  before.forget_moved(refined);
  mesh = std::move(refined);
  done.edges += report.edges;
  done.surfaces.insert(report.surfaces.begin(), report.surfaces.end());
  return report.edges;
}

std::string full_sentence(std::size_t most_cells) {
  return "Refining has ended because the mesh may have at most " + std::to_string(most_cells) +
         " elements; with a larger refine_growth it may go on.";
}

std::string Refinement::sentence(std::size_t before, std::size_t after) const {
  constexpr std::size_t kShown = 10;
  std::string where;
  std::size_t shown = 0;
  for (const std::string& surface : surfaces) {
    if (shown == kShown) break;
    where += (shown++ == 0 ? (surfaces.size() == 1 ? " at surface " : " at surfaces ") : ", ") + surface;
  }
  if (surfaces.size() > kShown) where += " and " + std::to_string(surfaces.size() - kShown) + " more";
  return "Refining split " + std::to_string(edges) + (edges == 1 ? " edge" : " edges") + where +
         " of the model; the mesh has " + std::to_string(after - before) + " more elements than the " +
         std::to_string(before) + " with which it came.";
}

}  // namespace varimesh
