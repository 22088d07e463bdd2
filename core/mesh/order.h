// Another polynomial order for a whole mesh: on the way in, a linear mesh becomes a straight-sided one of order P.
#pragma once

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The mesh with every element, boundary elements included, of order `order` (1 to kMaxOrder). The geometry is
/// interpolated at the new order's equispaced nodes, which is exact where the order is raised or the cells are
/// straight-sided. Nodes that two elements share are found by their vertices and their place between them, never by
/// coordinates, so the result conforms wherever the mesh did.
///
/// Vertices keep their numbers and coordinates, bit for bit; every other node of an element is new and is numbered
/// after the largest number there is. Elements, entities, physical groups and periodic links carry over; fields on
/// nodes in sections that VariMesh does not use ($NodeData, $ElementNodeData) are left out, since they belong to nodes
/// that are gone. A mesh that is of that order throughout is returned as it is.
/// Errors: BadOption for an order that is not 1 to kMaxOrder; BadInput where an element's nodes do not fit its shape.
Expected<HighOrderMesh> change_order(const HighOrderMesh& mesh, int order);

}  // namespace varimesh
