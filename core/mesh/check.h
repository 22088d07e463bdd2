// Checks whether a mesh can be judged and optimised. Every error names the element or node and says what to do.
#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

class Team;
struct BoundingBox;
struct Facets;

/// Refuses meshes with more nodes or cells than kMostNodes and kMostCells. Errors: BadInput.
Expected<void> check_counts(std::int64_t nodes, std::int64_t cells);

/// Checks everything that an optimisation and the measures of quality rely on:
///   - there are not too many nodes or cells: check_counts()
///   - there are elements of dimension 2 or 3, of one order and of known shapes
///   - the numbers of nodes and elements are from -2^62 to 2^62, so that there are numbers for new ones
///   - all coordinates are finite, and a 2-D mesh lies in a plane z = constant (check_mesh() takes any plane)
///   - the nodes of each cell are distinct, and no cell appears twice
///   - cells conform: a facet has one or two cells, which have the same nodes on it
/// Cells may be inverted, with curved sides and with straight sides.
/// Errors: BadInput, which describes the first fault, says how many there are of its kind, and what to do.
Expected<void> check_structure(const HighOrderMesh& mesh);
/// The same, shared by the threads of a team. The first fault is the same for any number of threads. Call it inside
/// team.run().
/// @param found if not null, receives the facets, which the check has to find (core/mesh/connectivity.h)
Expected<void> check_structure(const HighOrderMesh& mesh, const Team& team, Facets* found = nullptr);

/// The part of check_structure() that depends on the places of nodes. Call it inside team.run(). Errors: BadInput.
Expected<void> check_places(const HighOrderMesh& mesh, const Team& team);

/// Whether a 2-D mesh lies in a plane z = constant, but for rounding errors: 10⁻⁶ of its diagonal. Call it inside
/// team.run().
bool lies_flat(const HighOrderMesh& mesh, const Team& team);

/// The same for a mesh with this box.
bool lies_flat(const BoundingBox& box);

/// Whether the mesh is a surface in space: 2-D, and not in a plane z = constant. Call it inside team.run().
bool is_surface(const HighOrderMesh& mesh, const Team& team);
bool is_surface(const HighOrderMesh& mesh);

/// Checks a mesh that is only to be judged: check_structure(), but a surface in space passes. Its cells may be numbered
/// in any sense, any number of them may meet at an edge, and they need not conform, because each is judged without its
/// neighbours. `found` stays as it is if the mesh is a surface in space. Call it inside team.run(). Errors: BadInput.
Expected<void> check_judgeable(const HighOrderMesh& mesh, const Team& team, Facets* found = nullptr);
Expected<void> check_judgeable(const HighOrderMesh& mesh);

/// The checks of check_structure() that look at one element or node at a time, for a part of a mesh: kind, arrays,
/// coordinates, distinct nodes. Call it inside team.run(). Errors: BadInput, with the counts of the part.
Expected<void> check_part(const HighOrderMesh& part, const Team& team);
/// The other checks of check_structure(), for known facets. Call it inside team.run(). Errors: BadInput.
Expected<void> check_together(const HighOrderMesh& mesh, const Facets& facets, const Team& team);

/// Checks that each block has a possible order, as many nodes as its elements need, and only nodes of the mesh. Errors:
/// BadInput.
Expected<void> check_blocks(const HighOrderMesh& mesh);

}  // namespace varimesh
