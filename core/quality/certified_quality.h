// The quality report of a mesh whose cells are certified already.
#pragma once

#include <vector>

#include "core/quality/quality.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// quality() without certifying again. `certificates` are those of `certifier` for mesh.coordinates, one per cell in
/// the mesh's order. Do not call it inside team.run().
QualityReport quality(const HighOrderMesh& mesh, const Certifier& certifier, std::vector<Certificate> certificates,
                      int intervals, const Team& team);

}  // namespace varimesh
