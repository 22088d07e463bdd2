// Checks whether a mesh can be optimised. Every error names the element or node and says what to do.
#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

class Team;
struct Facets;

/// What check() finds out about an accepted mesh.
struct MeshCheck {
  bool clockwise = false;  ///< The vertices of all cells, in 2-D or 3-D, are in mirrored order.
};

/// Checks everything that an optimisation relies on: check_structure(), and that all straight-sided cells (the cells
/// that their vertices define) have a positive Jacobian, or all of them a negative one.
/// Errors: BadInput, which describes the first fault, says how many there are of its kind, and what to do.
Expected<MeshCheck> check(const HighOrderMesh& mesh);

/// The same, shared by the threads of a team. The first fault is the same for any number of threads. Call it inside
/// team.run().
/// @param found if not null, receives the facets, which the check has to find (core/mesh/connectivity.h)
Expected<MeshCheck> check(const HighOrderMesh& mesh, const Team& team, Facets* found = nullptr);

/// Checks everything that the measures of quality rely on:
///   - there are elements of dimension 2 or 3, of one order and of known shapes
///   - all coordinates are finite, and a 2-D mesh lies in a plane z = constant
///   - the nodes of each cell are distinct, and no cell appears twice
///   - cells conform: a facet has one or two cells, which have the same nodes on it
/// Straight-sided cells may be inverted: an optimised mesh may contain such cells if they cannot be repaired or if
/// their curved edges leave room. Errors as for check().
Expected<void> check_structure(const HighOrderMesh& mesh);
/// The same, shared by the threads of a team; `found` as for check(). Call it inside team.run().
Expected<void> check_structure(const HighOrderMesh& mesh, const Team& team, Facets* found = nullptr);

/// Checks that each block has a possible order, as many nodes as its elements need, and only nodes of the mesh. Errors:
/// BadInput.
Expected<void> check_blocks(const HighOrderMesh& mesh);

}  // namespace varimesh
