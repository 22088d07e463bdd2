// What is tried for elements that a run has left invalid, before they are given up. Internal to core/optimise.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/stop_token.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/optimise/set_up.h"

namespace varimesh {

/// What was tried.
struct OtherWays {
  bool tried = false;
  /// The number of elements that are left uncertified if the mesh is first raised by one order; absent if this was not
  /// tried, or leaves as many elements or more.
  std::optional<std::int64_t> left_at_next_order{};
};

/// Tries other energies and targets on the mesh as it came if `result`, the result of a run with this set-up that has
/// ended by itself,
/// - has left a cell that belongs to no unrepairable group, or more cells than must stay (least_invalid()): the first
///   way that leaves no such cell is taken, or else the one that leaves the fewest;
/// - or has Objective::Accuracy, and the descent left a valid mesh as it was: the way is taken if its loss is lower;
/// - or has Objective::Worst: the default objective is tried too, whatever its work. It is taken if it leaves fewer
///   cells, or as many and a higher minimum;
/// - or has Objective::Accuracy, and small patches have made the mesh valid after the descent: the run goes on from
///   this mesh, and nothing else is tried.
/// From the mesh that is taken, the run goes on with the options that were given. If no mesh is better, the result
/// stays. All attempts together, except the one with the default objective, do at most a multiple of the work of the
/// run. Iterations are numbered through. With RunControl::another_follows nothing is tried for cells that are left.
///
/// Attempts make no checkpoints: a run that goes on from one makes them again. They free the tables of the set-up, and
/// SetUp::is_spent says so. If cells are left that may become valid, and work, time and memory are left too, the last
/// attempt is the mesh raised by one order. It is only reported, because a run does not change the order by itself.
OtherWays try_other_ways(SetUp& set_up, const OnIteration& on_iteration, const RunControl& control, StopToken& stop,
                         Result& result);

}  // namespace varimesh
