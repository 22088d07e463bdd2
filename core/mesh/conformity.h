// Checks that neighbouring cells fit together. Used by check_structure().
#pragma once

#include "core/base/error.h"
#include "core/mesh/connectivity.h"

namespace varimesh {

/// Checks that no facet has three cells, that no face with four vertices meets faces with three, and that the elements
/// on both sides of a facet or edge have the same nodes there, at the same positions.
/// Reports the first fault in the order of the cells. Call it inside team.run().
Expected<void> check_conformity(const HighOrderMesh& mesh, const Facets& facets, const Team& team);

}  // namespace varimesh
