// What HOPR's, CGNS and PyFR's files have no place for.
#include "core/formats/common/left_out.h"

#include <algorithm>
#include <vector>

#include "core/formats/hdf5/hdf5.h"
#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/neighbours.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

namespace {

std::vector<bool> used_by_cells(const HighOrderMesh& mesh) {
  std::vector<bool> used(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      for (const std::int32_t node : block.nodes) used[std::size_t(node)] = true;
  return used;
}

}  // namespace

Expected<void> check_hopr_sides(const HighOrderMesh& mesh, const Team& team) {
  return mesh.dimension == 3 ? check_two_at_sides(mesh, team, kHoprName) : Expected<void>();
}

Expected<void> check_pyfr_sides(const HighOrderMesh& mesh, const Team& team) {
  return check_two_at_sides(mesh, team, kPyfrName);
}

std::string not_in_hopr(const HighOrderMesh& mesh) {
  if (mesh.dimension != 3) return "";  // which cannot be written
  LeftOut lost;
  lost.small_elements(mesh);
  lost.stray_sides(SideNeighbours(mesh, Cells(mesh, 3), Team(1)).stray());
  bool named = false, second = false;
  for (const ElementBlock& block : mesh.blocks) {
    const int dimension = reference::info(block.shape).dimension;
    second = second || (dimension >= 2 && block.physical.size() > 1);
  }
  for (const PhysicalGroup& group : mesh.physical_groups)
    named = named || (group.dimension == 3 && !group.name.empty());
  // Nodes keep their numbers if these count the nodes that cells use.
  std::int64_t used = 0, most = 0;
  const std::vector<bool> is_used = used_by_cells(mesh);
  for (std::size_t node = 0; node < is_used.size(); ++node)
    if (is_used[node]) {
      ++used;
      most = std::max(most, mesh.node_numbers[node]);
    }
  lost.count(std::int64_t(is_used.size()) - used, "node without a cell", "nodes without a cell");
  lost.add_if(named, "names of groups of cells");
  lost.add_if(second, "the second group of an element");
  lost.entities_and_partitions(mesh);
  lost.numbers_if(most > used || !are_elements_counted(mesh, {3}));
  return lost.sentence("HOPR's format");
}

std::string not_in_cgns(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.small_elements(mesh);
  for (const ForeignSection& section : mesh.foreign)
    lost.add_if(section.format == "cgns" && section.name == kCgnsZones,
                "the division into zones, which are subregions of one zone");
  lost.add_if(!mesh.periodic.empty(), "periodic links");
  lost.entities_and_partitions(mesh);
  lost.numbers_if(!are_nodes_counted(mesh) || !are_elements_counted(mesh, {mesh.dimension, mesh.dimension - 1}));
  return lost.sentence("VariMesh's CGNS file");
}

std::string not_in_pyfr(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.small_elements(mesh);
  bool cells = false, second = false;
  for (const ElementBlock& block : mesh.blocks) {
    second = second || (reference::info(block.shape).dimension == mesh.dimension - 1 && block.physical.size() > 1);
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    cells = cells || !block.physical.empty();
  }
  lost.stray_sides(SideNeighbours(mesh, Cells(mesh, mesh.dimension), Team(1)).stray());
  lost.add_if(cells, "groups of cells");
  lost.add_if(second, "the second group of boundary elements");
  lost.entities_and_partitions(mesh);
  lost.numbers_if(!are_nodes_counted(mesh) || !are_elements_counted(mesh, {mesh.dimension}));
  return lost.sentence("PyFR's format");
}

}  // namespace varimesh::formats
