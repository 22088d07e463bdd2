// Joins the zones of a CGNS file to one mesh. Internal to core/formats.
//
// Source: CGNS SIDS, "Multizone Interface Connectivity": GridConnectivity_t with the type Abutting1to1 pairs the points
// of its PointList with those of its PointListDonor.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/common/file_allowance.h"
#include "core/hdf/cgns/tree.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// A zone whose nodes and elements are in the mesh.
struct CgnsZone {
  std::string name;
  Hdf5Group node;
  std::int64_t first_node = 0, nodes = 0;        ///< Its nodes in the mesh: the first, counted from 0, and how many.
  std::int64_t first_element = 0, elements = 0;  ///< Its elements in the same way, by number, which counts from 1.
};

/// Makes one node of nodes that the zones' connectivities pair, and leaves out sides between joined zones that are in
/// no group. Periodic connectivities join nothing. Throws ReadFailure.
void join_cgns_zones(const std::vector<CgnsZone>& zones, HighOrderMesh& mesh, FileAllowance& allowance);

}  // namespace varimesh::formats
