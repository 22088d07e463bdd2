// Matches the surfaces of a mesh with those of a geometry. Internal to core/association.
#pragma once

#include <string>
#include <vector>

#include "core/association/association.h"

namespace varimesh::detail {

/// By node of the mesh: the sorted tags of the surfaces whose elements it belongs to.
using NodeSurfaces = std::vector<std::vector<int>>;
NodeSurfaces surface_tags_by_node(const HighOrderMesh& mesh);

/// By node of the mesh: whether it lies on an edge of only one surface element. There the elements end, so such a node
/// may not move across the surface.
std::vector<bool> border_nodes(const HighOrderMesh& mesh);

/// One entry per surface of the mesh, by increasing tag.
/// @param tolerance in the mesh's unit of length
std::vector<SurfaceMatch> match_surfaces(const HighOrderMesh& mesh, const NodeSurfaces& tags,
                                         const geometry::Geometry& geometry, double tolerance, const Team& team);

/// A number with three digits.
std::string number_text(double number);

}  // namespace varimesh::detail
