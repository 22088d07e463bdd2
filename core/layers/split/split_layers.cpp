#include "core/layers/split/split_layers.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/base/index.h"
#include "core/layers/split/cut_mesh.h"
#include "core/layers/split/layer_cuts.h"
#include "core/layers/split/layer_heights.h"
#include "core/layers/split/sheets.h"
#include "core/layers/split/wall_columns.h"
#include "core/layers/walls.h"
#include "core/mesh/changes/to_simplices.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/topology.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

/// Call it inside team.run().
std::vector<Certificate> certificates_of(const HighOrderMesh& mesh, const Team& team) {
  const Certifier certifier(mesh, {}, team);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  return certificates;
}

std::int64_t uncertified(std::span<const Certificate> certificates) {
  return std::ranges::count_if(certificates, [](const Certificate& c) { return !c.is_valid(); });
}

/// Splits the mesh, and certifies the parts. Call it inside team.run().
Expected<void> split_and_certify(const HighOrderMesh& mesh, const Topology& topology, const detail::Sheets& sheets,
                                 const detail::WallColumns& wall, const LayerOptions& wanted, const Team& team,
                                 SplitLayers& into) {
  const auto cuts = detail::cut_layers(mesh, topology, sheets, wall, wanted, into.report);
  if (!cuts) return tl::unexpected(cuts.error());
  auto cut = detail::cut_mesh(mesh, topology, *cuts, wall.in_rows, into.report);
  if (!cut) return tl::unexpected(cut.error());
  into.mesh = std::move(cut->mesh);
  into.parents = std::move(cut->parents);
  into.certificates = certificates_of(into.mesh, team);
  return {};
}

/// Cuts the cells into simplices.
Expected<void> cut_into_simplices(SplitLayers& layers) {
  std::vector<std::int32_t> parents;
  auto simplices = to_simplices(layers.mesh, &parents);
  if (!simplices) return tl::unexpected(simplices.error());
  layers.mesh = std::move(*simplices);
  for (std::int32_t& parent : parents) parent = layers.parents[at(parent)];
  layers.parents = std::move(parents);
  layers.certificates.clear();
  layers.report.cells_after = static_cast<std::int64_t>(layers.mesh.element_count(layers.mesh.dimension));
  return {};
}

/// How many cells there are at most with these cuts: a cell has as many parts as all sheets together that cut it.
std::int64_t most_cells(const HighOrderMesh& mesh, const Topology& topology, const detail::Sheets& sheets,
                        const detail::LayerCuts& cuts) {
  const Cells cells(mesh, mesh.dimension);
  std::int64_t most = 0;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    std::map<std::int32_t, std::int64_t> parts;  // by sheet
    const auto nodes = cells.nodes(c);
    for (const auto& [a, b] : kGmshParts.edges(cells.shape(c)))
      if (const std::int32_t edge = topology.edge(nodes[at(a)], nodes[at(b)]); cuts.is_cut(edge))
        parts[sheets.sheet(edge)] = cuts.parts(edge);
    std::int64_t all = 1;
    for (const auto& [sheet, count] : parts) all *= count;
    most += all;
  }
  return most;
}

/// How many cells there will be if the walls get thick cells first.
Expected<std::int64_t> cells_if_grown(const CheckedMesh& mesh, const LayerOptions& wanted) {
  if (const auto checked = check(wanted); !checked) return tl::unexpected(checked.error());
  const auto walls = detail::find_walls(mesh.mesh, mesh.facets, wanted.walls);
  if (!walls) return tl::unexpected(walls.error());
  const int parts = detail::number_of_layers(wanted, wanted.grow) + (wanted.fills() ? 0 : 1);
  return static_cast<std::int64_t>(mesh.mesh.element_count(mesh.mesh.dimension)) + parts * std::ssize(*walls);
}

/// The columns above the walls. Errors: see split_layers().
Expected<detail::WallColumns> columns_above(const CheckedMesh& mesh, const LayerOptions& wanted) {
  if (const auto checked = check(wanted); !checked) return tl::unexpected(checked.error());
  if (mesh.facets.first.empty())
    return bad_input("The mesh is a surface in space. Layers can be made in meshes of the plane and of space.");
  return detail::find_wall_columns(mesh, wanted.walls, wanted.rows);
}

}  // namespace

Expected<std::int64_t> check_layers(const CheckedMesh& mesh, const LayerOptions& wanted, const Team& team) {
  if (wanted.grow > 0) return cells_if_grown(mesh, wanted);
  const auto wall = columns_above(mesh, wanted);
  if (!wall) return tl::unexpected(wall.error());
  Expected<std::int64_t> cells;
  team.run([&] {
    const Topology topology = varimesh::topology(mesh.mesh, Topology::Faces::None, team);
    const detail::Sheets sheets(mesh.mesh, topology);
    LayerSplitReport report;
    const auto cuts = detail::cut_layers(mesh.mesh, topology, sheets, *wall, wanted, report);
    cells =
        cuts ? Expected<std::int64_t>(most_cells(mesh.mesh, topology, sheets, *cuts)) : tl::unexpected(cuts.error());
  });
  return cells;
}

Expected<SplitLayers> split_layers(const CheckedMesh& mesh, const LayerOptions& wanted, const Team& team) {
  const auto wall = columns_above(mesh, wanted);
  if (!wall) return tl::unexpected(wall.error());
  SplitLayers result;
  Expected<void> done;
  team.run([&] {
    const Topology topology = varimesh::topology(mesh.mesh, Topology::Faces::None, team);
    const detail::Sheets sheets(mesh.mesh, topology);
    done = split_and_certify(mesh.mesh, topology, sheets, *wall, wanted, team, result);
    const std::int64_t left = uncertified(result.certificates);
    if (!done || left == 0 || left <= uncertified(certificates_of(mesh.mesh, team))) return;
    SplitLayers exact;
    exact.report.same_shares = true;
    done = split_and_certify(mesh.mesh, topology, sheets, *wall, wanted, team, exact);
    if (done && uncertified(exact.certificates) < left) result = std::move(exact);
  });
  if (!done) return tl::unexpected(done.error());
  if (mesh.plane) {
    mesh.plane->put_back(result.mesh);
    result.certificates.clear();
  }
  if (wanted.simplices)
    if (const auto cut = cut_into_simplices(result); !cut) return tl::unexpected(cut.error());
  return result;
}

}  // namespace varimesh
