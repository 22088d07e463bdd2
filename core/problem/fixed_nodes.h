// Which nodes may move: the boundary by default, and what the user fixes, frees or leaves out.
#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// For every node whether it is fixed, in this order:
/// 1. the nodes on facets with one neighbour and on every element of one dimension less (see fixed_nodes), but for the
///    elements of the groups in `options.free`; a node that another such element or the outer boundary has stays fixed;
/// 2. `free_nodes` are let go, each with all nodes of the vertex, edge or face that it lies in and of whatever that one
///    bounds, since nothing may move at the rim of what is fixed;
/// 3. `fix` and `fix_nodes` are fixed, each node with all nodes of its edge or face and of its rim;
/// 4. with `region_below`, every node that a cell has outside the region: the cells whose scaled Jacobian is below it
///    and `rings` layers of cells round them, neighbours by a vertex. These nodes come back bit for bit.
///
/// Expects a mesh that has passed check(). Errors: BadOption for a group or node that is not there, for a group to be
/// freed that is not of interface elements, and for what lies on the outer boundary, which has no geometry to slide on.
Expected<std::vector<bool>> choose_fixed_nodes(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
