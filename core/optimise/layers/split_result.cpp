#include "core/optimise/layers/split_result.h"

#include <algorithm>
#include <utility>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/diagnosis/diagnosis.h"
#include "core/mesh/mesh_counts.h"
#include "core/quality/certified_quality.h"

namespace varimesh {

Expected<LayersMade> split_result(Result& result, const LayerOptions& wanted, const ThicknessShares& grown,
                                  int threads) {
  const Stopwatch watch;
  const Team team(threads);
  const auto checked = check_mesh(std::move(result.mesh), CheckFor::Optimising, team);
  if (!checked) return tl::unexpected(checked.error());
  const auto thickness = thickness_of_cells(*checked, wanted.walls, grown);
  if (!thickness) return tl::unexpected(thickness.error());
  auto split = split_layers(*checked, wanted, team);
  if (!split) return tl::unexpected(split.error());
  result.mesh = std::move(split->mesh);
  LayersMade made{split->report,
                  std::exchange(result.after, quality(result.mesh, std::move(split->certificates), team)),
                  thickness_of_parts(*thickness, split->parents)};
  const std::vector<std::int64_t> uncertified = uncertified_numbers(result.after);
  result.unrepairable = with_any_of(std::move(result.unrepairable), uncertified);
  result.left = what_is_left(result.mesh, uncertified, result.unrepairable, {.movement = true});
  result.sizes.elements = split->report.cells_after;
  result.sizes.nodes = static_cast<std::int64_t>(result.mesh.node_count());
  result.seconds += watch.seconds();
  return made;
}

Expected<std::int64_t> memory_of_layers(const CheckedMesh& of, const LayerOptions& wanted, std::int64_t run, int order,
                                        const Team& team) {
  const auto cells = check_layers(of, wanted, team);
  if (!cells) return cells;
  const HighOrderMesh& mesh = of.mesh;
  const MeshCounts counts = count(mesh, order > 0 ? order : mesh.order);
  // A mesh, its facets and certificates, and while layers are even because others would fold, a second mesh.
  constexpr double kMeshes = 4;
  constexpr double kSimplices = 6;  // of a hexahedron
  const double had = static_cast<double>(std::max<std::int64_t>(1, counts.cell_count()));
  const double growth = static_cast<double>(*cells) / had;
  double bytes = static_cast<double>(bytes_of_mesh(counts)) * growth * (kMeshes + (wanted.simplices ? kSimplices : 0));
  if (wanted.grow > 0) {
    // The equations of the body that moves away, and the row of cells in the run.
    const double equations = (mesh.dimension == 2 ? 700 : 2800) * had;
    const double walls = static_cast<double>(mesh.element_count(mesh.dimension - 1));
    bytes = std::max(bytes + static_cast<double>(run) * walls / had, equations);
  }
  return static_cast<std::int64_t>(bytes);
}

}  // namespace varimesh
