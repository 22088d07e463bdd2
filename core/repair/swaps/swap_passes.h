// Swaps and collapses pass by pass, until they help no more. Internal to the library.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/base/stop_token.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// What swap_in_passes() is to do.
struct SwapTask {
  const Options& options;  ///< Which nodes are fixed, and how many threads there are.
  double aim = 0;  ///< Cells with a smaller scaled Jacobian are wanted too; 0: only those that are not certified.
  /// Numbers of elements with a folded boundary face, in ascending order. Nothing is tried for them.
  std::vector<std::int64_t> hopeless;
  /// Numbers of elements that no movement makes valid, in ascending order. Changes are tried for them. While others
  /// around are raised, they do not count.
  std::vector<std::int64_t> stuck;
  /// Called before each pass with the number of wanted cells; may be empty.
  std::function<void(std::int64_t wanted)> on_pass;
};

/// Takes the wanted triangles and tetrahedra, the lowest first. Around each, a patch of two layers of cells is changed:
/// of the changes around the cell (changes_around.h), the ten that look best are made one by one in a copy of the
/// patch, and the smallest scaled Jacobian of the copy is raised as far as the max-min program comes
/// (core/solvers/maxmin/raise.h). The best copy is kept if no cell beside the change loses its certificate, and if
/// fewer cells are left uncertified, or as many and the smallest scaled Jacobian is higher (core/merit/merit.h). Then
/// the cell's successors are looked at in the same way, at most four times.
///
/// Patches of one pass share no cell. Cells for which nothing helped are tried again only if a patch with them has
/// changed. The cells that are looked at are bounded by a multiple of the mesh. Ends after eight passes, if a pass
/// changes nothing, or if `stop` says so; what was done until then stays.
///
/// Boundary nodes, elements of lower dimension and their nodes stay bit for bit. A 2-D mesh must lie in a plane
/// z = constant; others come back as they are. Adds a step to `steps` for each change. The result does not depend on
/// the number of threads. Do not call it inside team.run().
HighOrderMesh swap_in_passes(HighOrderMesh mesh, const SwapTask& task, std::vector<RepairStep>& steps,
                             const StopToken& stop);

}  // namespace varimesh
