#include "core/layers/split/split_layers.h"

#include "core/layers/split/cut_mesh.h"
#include "core/layers/split/layer_cuts.h"
#include "core/layers/split/sheets.h"
#include "core/layers/split/wall_columns.h"
#include "core/mesh/topology.h"

namespace varimesh {

Expected<SplitLayers> split_layers(const CheckedMesh& mesh, const LayerSplit& wanted, const Team& team) {
  if (const auto checked = check(wanted.heights); !checked) return tl::unexpected(checked.error());
  if (wanted.rows < 1) return bad_option("The number of rows to split is not at least 1.");
  if (mesh.facets.first.empty())
    return bad_input("The mesh is a surface in space. Layers can be made in meshes of the plane and of space.");
  const auto wall = detail::find_wall_columns(mesh, wanted.walls, wanted.rows);
  if (!wall) return tl::unexpected(wall.error());
  SplitLayers result;
  Expected<void> done;
  team.run([&] {
    const Topology topology = varimesh::topology(mesh.mesh, Topology::Faces::None, team);
    const detail::Sheets sheets(mesh.mesh, topology);
    const auto cuts = detail::cut_layers(mesh.mesh, topology, sheets, *wall, wanted, result.report);
    if (!cuts) return void(done = tl::unexpected(cuts.error()));
    auto cut = detail::cut_mesh(mesh.mesh, topology, *cuts, wall->in_rows, result.report);
    if (!cut) return void(done = tl::unexpected(cut.error()));
    result.mesh = std::move(*cut);
  });
  if (!done) return tl::unexpected(done.error());
  return result;
}

}  // namespace varimesh
