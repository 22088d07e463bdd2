// The elements of the walls that a user names. Internal to core/layers.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// An element of a wall, and the facet of the cell on which it lies.
struct WallElement {
  std::int32_t facet = -1;    ///< As Facets counts.
  std::int32_t element = -1;  ///< Among the elements of one dimension less than the mesh.
};

/// The elements of these walls in the order of their facets.
/// Errors: BadOption if a wall does not exist or has no elements on the boundary; BadInput if an element of a wall has
/// cells on both sides.
/// @param names  groups of elements of one dimension less than the mesh: names or tags of physical groups, or tags of
///               entities; "all" names the whole boundary, unless a group has that name
Expected<std::vector<WallElement>> find_walls(const HighOrderMesh& mesh, const Facets& facets,
                                              std::span<const std::string> names);

}  // namespace varimesh::detail
