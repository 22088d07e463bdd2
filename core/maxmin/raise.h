// Raises the smallest scaled Jacobian of a mesh, patch by patch, where the energies leave cells invalid or poor.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// What raise_low_cells() did.
struct RaiseOutcome {
  std::vector<std::int64_t> made_valid;  ///< Numbers of the elements that are certified now and were not before.
  std::vector<std::int64_t> raised;      ///< Of the others: those that were below the aim, and are higher now.
  bool interrupted = false;              ///< The team's token has ended it.
};

/// Takes the cells that are not certified valid, or have less than `aim` of the scaled Jacobian, the lowest first. The
/// cells around each (neighbours by a vertex) form a patch (patch.h). If that does not raise the cell to the aim, the
/// patch takes one more layer of cells. A patch goes back to where it was if a cell would lose its
/// certificate, or if neither more of its cells are certified nor its smallest scaled Jacobian is higher. Cells of
/// which the boundary proves that they stay invalid (`hopeless`, by cell) are left out. The cells of a mesh that are
/// looked at are bounded by a multiple of the mesh.
///
/// `fixed` is by node. `certificates` are those of mesh.coordinates on entry and again afterwards, one per cell. If
/// `aim` is 0, only cells that are not certified are taken. Cells whose sample table would be too large are left as
/// they are: hexahedra from order 7 on. Do not call it inside team.run(). The result does not depend on the number of
/// threads.
RaiseOutcome raise_low_cells(HighOrderMesh& mesh, const std::vector<bool>& fixed, std::span<const char> hopeless,
                             const Certifier& certifier, std::vector<Certificate>& certificates, double aim,
                             const Team& team);

}  // namespace varimesh
