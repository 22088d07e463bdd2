#include "core/optimise/on_geometry/refine_on_model.h"

#include <utility>

#include "core/association/association.h"
#include "core/association/match.h"
#include "core/association/plane/profile.h"
#include "core/base/team.h"
#include "core/mesh/node_parameters.h"
#include "core/mesh/plane.h"
#include "core/repair/boundary/boundary_swaps.h"
#include "core/repair/boundary/refine.h"
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
  std::size_t swapped = 0;
  team.run([&] {
    association = lies_in_a_plane(mesh, team) ? associate_in_plane(mesh, model, team) : associate(mesh, model, team);
    if (!association) return;
    swapped = swap_boundary_edges(refined, *association, wanted, *held, done.steps, report.surfaces, team);
    if (swapped == 0) report = refine(refined, *association, {wanted, most_cells, std::move(*held)}, done.steps, team);
  });
  if (!association) return tl::unexpected(association.error());
  done.is_full = report.is_full;
  if (report.edges + swapped == 0) return 0;
  before.forget_moved(refined);
  mesh = std::move(refined);
  done.edges += report.edges;
  done.swapped += swapped;
  done.surfaces.insert(report.surfaces.begin(), report.surfaces.end());
  return report.edges + swapped;
}

std::string full_sentence(std::size_t most_cells) {
  return "Refining has ended because the mesh may have at most " + std::to_string(most_cells) +
         " elements; with a larger refine_growth it may go on.";
}

std::string farther_sentence(const SlideReport& report) {
  if (!(report.after.largest > report.before.largest || report.after.rms > report.before.rms)) return "";
  return " The boundary may lie farther from the model now: by at most " + detail::number_text(report.after.largest) +
         ", and by " + detail::number_text(report.before.largest) +
         " before. Splits inside the mesh would leave the boundary where it is.";
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
  const auto counted = [](std::size_t count) { return std::to_string(count) + (count == 1 ? " edge" : " edges"); };
  std::string what = edges > 0 ? "split " + counted(edges) : "";
  if (swapped > 0) what += (edges > 0 ? " and swapped " : "swapped ") + counted(swapped);
  const std::size_t change = after < before ? before - after : after - before;
  return "Refining " + what + where + " of the model; the mesh has " + std::to_string(change) +
         (after < before ? " fewer" : " more") + " elements than the " + std::to_string(before) +
         " with which it came.";
}

}  // namespace varimesh
