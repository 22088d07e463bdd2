// Raises the smallest scaled Jacobian of a mesh, patch by patch, where the energies leave cells invalid or poor.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// What raise_low_cells() works on. All references must outlive the call.
struct RaiseTask {
  const HighOrderMesh& mesh;       ///< Its coordinates do not matter.
  const std::vector<bool>& fixed;  ///< By node.
  std::span<const char> hopeless;  ///< By cell: 1 if the boundary proves that the cell stays invalid.
  const Certifier& certifier;
  double aim = 0;  ///< Of the scaled Jacobian; 0: only cells that are not certified are taken.
};

/// What is remembered from one call to the next, if a mesh is raised in parts. At first it is empty.
struct RaiseMemory {
  std::vector<char> tried;    ///< By cell: the patches around it were tried.
  std::vector<double> level;  ///< By cell that was tried: its scaled Jacobian at the samples afterwards.
  std::vector<double> shift;  ///< By cell: MaxMinPatch::Cell::shift.
  std::int64_t looks = 0;     ///< At cells so far.
};

/// What raise_low_cells() did.
struct RaiseOutcome {
  std::vector<std::int64_t> made_valid;  ///< Numbers of the elements that are certified now and were not before.
  std::vector<std::int64_t> raised;      ///< Of the others: those that were below the aim, and are higher now.
  std::int64_t patches = 0;              ///< How many were tried.
  bool finished = true;                  ///< No low cell is left that was not tried.
  bool interrupted = false;              ///< The team's token has ended it.
};

/// Takes the cells that are not certified valid, or have less than the aim of the scaled Jacobian, the lowest first.
/// The cells around each (neighbours by a vertex) form a patch (patch.h). If that does not raise the cell to the aim,
/// the patch takes one more layer of cells. A patch goes back to where it was if a cell would lose its
/// certificate, or if neither more of its cells are certified nor its smallest scaled Jacobian is higher. Hopeless
/// cells are left out. The cells of a mesh that are looked at are bounded by a multiple of the mesh.
///
/// `coordinates`: 3 per node, as HighOrderMesh::coordinates. `certificates` are those of the coordinates on entry and
/// again afterwards, one per cell. With a memory, only cells that it does not name as tried are taken, and no new cell
/// after `most_looks` more looks. Cells whose sample table would be too large are left as they are: hexahedra from
/// order 7 on. Call it inside team.run(). The result does not depend on the number of threads.
RaiseOutcome raise_low_cells(const RaiseTask& task, std::vector<double>& coordinates,
                             std::vector<Certificate>& certificates, const Team& team, RaiseMemory* memory = nullptr,
                             std::int64_t most_looks = 0);

/// Forgets that cells were tried, but for those that are not certified and as they were after that: another try would
/// end as the first. Forgets the looks too, so another raise_low_cells() may look as often as the first. The arguments
/// are those of raise_low_cells().
void forget_changed_cells(const RaiseTask& task, std::vector<double>& coordinates,
                          std::vector<Certificate>& certificates, const Team& team, RaiseMemory& memory);

}  // namespace varimesh
