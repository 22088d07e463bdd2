// Optimising with --repair split or topology: makes room by splits where the boundary leaves none, and optimises from
// there.
#pragma once

#include "core/base/stop_token.h"
#include "core/optimise/optimiser.h"
#include "core/optimise/set_up.h"

namespace varimesh {

/// The free function optimise() for Repair::Split and Repair::Topology. The mesh has passed check_structure() and needs
/// no change of order.
///
/// 1. Optimises the mesh without a split by at most forty Newton steps, without untangling. A mesh that is certified
///    valid is optimised as with Repair::Report, and that is the result.
/// 2. In the mesh as it came, splits in passes: groups of tetrahedra that have little room at the boundary
///    (split_candidates.h; a margin of at most 0.08) and an element that step 1 has left get room by splits. Each pass
///    works on the mesh that the last one made, until no such group is left that may be split.
/// 3. Optimises the mesh as with Repair::Report and RunControl::shallow_untangling.
/// 4. If elements are left that are not certified valid: in the mesh as it was before step 3, splits the groups at
///    their corners with J ≤ 0 whatever their margin. Then step 3 starts again. There are at most four such rounds, and
///    a round that leaves no fewer elements that a split might help is the last.
/// 5. With Repair::Topology: swaps and collapses edges and faces around what is left (swap_left.h), and optimises
///    again.
///
/// The best mesh of these is kept, by what the options ask for (core/merit/merit.h). If it has uncertified elements
/// without a folded boundary face, the mesh is also optimised without a split. If that, or step 1, leaves no more of
/// them, it is the result. The rounds together may do four times the work of step 1, and so may the run after them.
/// Work is counted in visits of free nodes, so it does not depend on the machine. The options' limits of time and
/// iterations are for everything together. Elements with a folded boundary face are never split for their own sake.
///
/// The stop reason is the stop reason of the run whose mesh is the result. But if elements are left, and a limit for
/// everything together or a stop kept this from going on, the reason is this limit or stop. The meter is told the
/// groups that each look has found. All this ends: there are at most eight passes per round.
///
/// A checkpoint has the results of the runs before, so that only the looks for splits between them are computed again.
///
/// `stop` is the token of the run. If it stops step 1 before its first iteration, the mesh is as it came.
Result optimise_by_splitting(const SetUp& set_up, const OnIteration& on_iteration, const RunControl& control,
                             StopToken& stop);

}  // namespace varimesh
