// Room where the boundary leaves none: splits what has to be split, and optimises from there.
#pragma once

#include "core/optimise/optimiser.h"

namespace varimesh {

/// The free function optimise() for Repair::Split and a mesh that has passed check() and needs no change of order.
///
/// 1. Groups of tetrahedra that have little room by the boundary (weak_groups(): a margin of at most 0.08) and an
///    element that is not certified valid are given room by splits, in passes over the mesh as it comes out of the
///    last, until no such group is left that may be split.
/// 2. The mesh is optimised as with Repair::Report.
/// 3. Second look: where elements are left, groups at their corners with J ≤ 0 are split whatever their margin, in the
///    mesh as it was before 2, and 2 begins again; four times at most.
///
/// The best mesh that came of that is kept: the fewest uncertified elements, of those the highest minimum Js. Where
/// some are left, the mesh is optimised without a split as well, and where that leaves no more, it is what comes out.
/// The options' limits of time and iterations are for all of it. Elements with a folded boundary face are never split
/// for their own sake. Why it ended is said of the run that the mesh is from, unless elements are left and a limit of
/// all of it, or a stop, kept it from going on. Of `control` the number of threads is used, and whether to stop is
/// asked between the steps of splitting: there are no checkpoints. It ends: there are at most eight passes a look.
Result optimise_by_splitting(const HighOrderMesh& mesh, const Options& options, const OnIteration& on_iteration,
                             const RunControl& control = {});

}  // namespace varimesh
