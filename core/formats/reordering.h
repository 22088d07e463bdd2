// Elements whose nodes are in the order of another program, although the file is an MSH file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/formats/common/format.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Takes the nodes of each element of the file to be in the order of a program: gmsh, vtk, cgns, exodus or abaqus.
/// Nodes that reading added to serendipity elements are placed again. Errors: BadOption if there is no such order, or
/// if the mesh does not come from an MSH file, whose readers know the order.
Expected<void> take_node_order(HighOrderMesh& mesh, Format read_as, std::string_view name);

/// The names of the orders of nodes in which the elements of a mesh fit together. Empty if they do in Gmsh's order.
std::vector<std::string> fitting_node_orders(const HighOrderMesh& mesh, Format read_as);

}  // namespace varimesh::formats
