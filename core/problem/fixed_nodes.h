// Which nodes are fixed: by default those of the boundary, and what the user fixes or frees.
#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// For every node whether it is fixed. The rules are applied in this order:
/// 1. The nodes of facets with only one cell (the outer boundary) and of every element of one dimension less are fixed
///    (see fixed_nodes). Elements of the groups in `options.free` do not fix their nodes. A node that also belongs to
///    the outer boundary or to another such element stays fixed.
/// 2. Each node in `free_nodes` is freed, together with all nodes of the vertex, edge or face that it lies in and of
///    everything that this vertex, edge or face bounds. The rim of a fixed edge or face must not move.
/// 3. The nodes of the groups in `fix` are fixed. Each node in `fix_nodes` is fixed too, together with all nodes of the
///    edge or face that it lies in and of its rim.
/// 4. With `region_below`, every node of a cell outside the region is fixed. The region consists of the cells whose
///    scaled Jacobian is below `region_below`, and of `rings` layers of cells around them (neighbours by a vertex). The
///    coordinates of the fixed nodes do not change by a bit.
///
/// Expects a mesh that has passed check_structure(). Errors: BadOption if a group or node does not exist, if a group to
/// be freed has no interface elements, and if a node or group to be freed lies on the outer boundary, since there is no
/// geometry to slide on.
Expected<std::vector<bool>> choose_fixed_nodes(const HighOrderMesh& mesh, const Options& options);
/// The same for facets that are known already.
Expected<std::vector<bool>> choose_fixed_nodes(const HighOrderMesh& mesh, const Options& options, const Facets& facets);

}  // namespace varimesh
