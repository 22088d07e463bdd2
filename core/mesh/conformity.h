// Whether neighbouring cells fit together: internal to check().
#pragma once

#include "core/base/error.h"
#include "core/mesh/connectivity.h"

namespace varimesh {

/// Checks that no facet has three cells, that no face of four vertices meets faces of three, and that the elements on
/// each side of a facet or edge have the same nodes there, in the same places.
Expected<void> check_conformity(const HighOrderMesh& mesh, const Facets& facets);

}  // namespace varimesh
