// The quality report of a mesh whose cells are certified already.
#pragma once

#include <span>
#include <vector>

#include "core/mesh/connectivity.h"
#include "core/quality/quality.h"
#include "core/ranks/ranks.h"
#include "core/validity/certifier.h"

namespace varimesh {

namespace detail {
class SamplesElsewhere;
}

/// quality() without certifying again. `certificates` are those of `certifier` for mesh.coordinates, one per cell in
/// the mesh's order. Do not call it inside team.run(). The team's token may interrupt it.
/// @param ranks      the ranks, each with a part of the mesh, a range of its cells. All get the report on the whole
///                   mesh, but only the first rank gets the lists of elements
/// @param elsewhere  samples the cells if it can (lattice_kernel.h); may be null
QualityReport quality(const HighOrderMesh& mesh, const Certifier& certifier, std::vector<Certificate> certificates,
                      int intervals, const Team& team, const Ranks& ranks = one_rank(),
                      detail::SamplesElsewhere* elsewhere = nullptr);

/// quality() of core/quality/quality.h with the team's threads. Do not call it inside team.run(). The team's token may
/// interrupt it. `facets`: the facets of the mesh, if they are known and the mesh is no surface in space.
QualityReport quality(const HighOrderMesh& mesh, int intervals, const Team& team, const Facets* facets = nullptr);

/// The same for a mesh whose cells are certified already, by a Certifier of this mesh. If cells are numbered clockwise,
/// or the mesh is a surface in space, or there are no certificates, the cells are certified again.
QualityReport quality(const HighOrderMesh& mesh, std::vector<Certificate> certificates, const Team& team);

/// The same as the first in a twentieth of the time, for runs that are to end at once: samples are only at the
/// vertices, at the middle of edges and between them (lattice_intervals 2), no bound is sharpened, and the loss of
/// accuracy is left out. It is never interrupted.
QualityReport quick_quality(const HighOrderMesh& mesh, std::span<const Certificate> certificates, const Team& team);

/// cell_quality() on the default lattice with the team's threads. The team's token may interrupt it.
CellQuality cell_quality(const HighOrderMesh& mesh, const Team& team);

/// The smallest and the mean scaled Jacobian.
struct ScaledJacobians {
  double smallest = 0, mean = 0;
};

/// The smallest and the mean scaled Jacobian of the mesh with its nodes at these coordinates (3 per node, interleaved),
/// as in QualityReport on the default lattice. `elsewhere` as above.
ScaledJacobians scaled_jacobians(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                                 detail::SamplesElsewhere* elsewhere = nullptr);

}  // namespace varimesh
