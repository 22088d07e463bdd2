#include "core/layers/split/split_layers.h"

#include <algorithm>

#include "core/layers/split/cut_mesh.h"
#include "core/layers/split/layer_cuts.h"
#include "core/layers/split/sheets.h"
#include "core/layers/split/wall_columns.h"
#include "core/mesh/topology.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// How many cells are not certified valid. Call it inside team.run().
std::int64_t uncertified(const HighOrderMesh& mesh, const Team& team) {
  const Certifier certifier(mesh, {}, team);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  return std::ranges::count_if(certificates, [](const Certificate& c) { return !c.is_valid(); });
}

}  // namespace

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
    const auto split = [&](SplitLayers& into) {
      const auto cuts = detail::cut_layers(mesh.mesh, topology, sheets, *wall, wanted, into.report);
      if (!cuts) return void(done = tl::unexpected(cuts.error()));
      auto cut = detail::cut_mesh(mesh.mesh, topology, *cuts, wall->in_rows, into.report);
      if (!cut) return void(done = tl::unexpected(cut.error()));
      into.mesh = std::move(*cut);
    };
    split(result);
    if (!done) return;
    const std::int64_t left = uncertified(result.mesh, team);
    if (left == 0 || left <= uncertified(mesh.mesh, team)) return;
    SplitLayers exact;
    exact.report.same_shares = true;
    split(exact);
    if (done && uncertified(exact.mesh, team) < left) result = std::move(exact);
  });
  if (!done) return tl::unexpected(done.error());
  if (mesh.plane) mesh.plane->put_back(result.mesh);
  return result;
}

}  // namespace varimesh
