// What does not hang together in a mesh that is sound otherwise.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Of these nodes, groups that hang together by distances of at most `tolerance`: each node but the lowest of its
/// group, with that lowest one. `nodes` ascends, and so do the pairs.
std::vector<std::pair<std::int32_t, std::int32_t>> coincident_nodes(const HighOrderMesh& mesh,
                                                                    const std::vector<std::int32_t>& nodes,
                                                                    double tolerance);

/// One sentence each, with a count and an example, on:
///   - nodes of the boundary that lie at the same place, up to 10⁻⁹ of the mesh's diagonal: parts were put together
///     without merging their nodes
///   - vertices of the boundary that lie on a boundary facet of another cell: hanging nodes
///   - elements of one dimension less than the cells that are no facet of a cell
///   - nodes that no cell has
/// Such meshes can be judged and optimised. But parts that should move together do not, and elements in no cell are no
/// boundary. The mesh must have passed check_structure(), and `facets` are its facets. Call it inside team.run().
std::vector<std::string> loose_parts(const HighOrderMesh& mesh, const Facets& facets, const Team& team);

/// The same without the sentence about nodes that no cell has. For these, the cells at the boundary and at the elements
/// of one dimension less are enough.
std::vector<std::string> loose_boundary(const HighOrderMesh& mesh, const Facets& facets, const Team& team);
/// The sentence about nodes that no cell has. `count` is how many there are, and `first` the number of the first; empty
/// if there are none.
std::string lone_nodes_text(std::int64_t count, std::int64_t first);

}  // namespace varimesh
