// Changes the polynomial order of a whole mesh. For example, a linear mesh becomes a straight-sided mesh of order P.
#pragma once

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The mesh with all elements, including boundary elements, of order `order`, 1 to kMaxOrder. The geometry is
/// interpolated at the equispaced nodes of the new order, which is exact if the order is raised or the cells are
/// straight-sided. Shared nodes are found by the vertices of their edge or face and their position on it, never by
/// coordinates. So the result conforms wherever the mesh did.
///
/// Vertices keep their numbers and their exact coordinates. All other nodes of elements are new, with numbers above all
/// existing ones. Elements, entities, physical groups and periodic links are kept. Fields on nodes in sections that
/// VariMesh does not use ($NodeData, $ElementNodeData) are dropped, because their nodes no longer exist. A mesh in
/// which all elements have this order already is returned unchanged. Errors: BadOption if the order is not 1 to
/// kMaxOrder; BadInput as for check_blocks().
Expected<HighOrderMesh> change_order(const HighOrderMesh& mesh, int order);

}  // namespace varimesh
