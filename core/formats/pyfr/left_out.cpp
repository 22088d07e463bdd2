// What PyFR's meshes have no place for.
#include "core/formats/left_out.h"

#include "core/formats/pyfr/pyfr.h"
#include "core/formats/sides/neighbours.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

std::string not_in_pyfr(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.small_elements(mesh);
  bool cells = false, second = false;
  std::int64_t next = 0;
  bool renumbers = false;
  for (const ElementBlock& block : mesh.blocks) {
    second = second || (reference::info(block.shape).dimension == mesh.dimension - 1 && block.physical.size() > 1);
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    cells = cells || !block.physical.empty();
    for (const std::int64_t number : block.numbers) renumbers = renumbers || number != ++next;
  }
  next = 0;
  for (const std::int64_t number : mesh.node_numbers) renumbers = renumbers || number != ++next;
  lost.count(SideNeighbours(mesh, Cells(mesh, mesh.dimension), Team(1)).stray(),
             "boundary element that is no side of an element", "boundary elements that are no sides of elements");
  lost.add_if(cells, "groups of cells");
  lost.add_if(second, "the second group of boundary elements");
  lost.entities_and_partitions(mesh);
  lost.add_if(renumbers, "the numbers of nodes and elements");
  return lost.sentence("PyFR's format");
}

}  // namespace varimesh::formats
