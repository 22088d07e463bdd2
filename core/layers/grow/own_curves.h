// The boundary of a plane mesh as curves, from where it leaves a wall. Internal to core/layers.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "core/association/association.h"
#include "core/layers/grow/outer_facets.h"

namespace varimesh::detail {

/// Curves of edges that begin at a wall and go on as long as edges of the same entity meet smoothly, as own_boundary()
/// says. The association has nothing but these curves.
/// @param side  gets the curve of each of their edges, by its sorted vertices
Association own_curves(const HighOrderMesh& mesh, std::span<const OuterFacet> outer,
                       std::map<std::vector<std::int32_t>, int>& side);

}  // namespace varimesh::detail
