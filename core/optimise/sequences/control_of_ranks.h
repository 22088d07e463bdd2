// What the ranks that share a run ask their callers. Internal to core/optimise.
#pragma once

#include "core/base/error.h"
#include "core/optimise/run_control.h"
#include "core/options/options.h"
#include "core/ranks/ranks.h"

namespace varimesh {

/// The ranks of a run; one without ranks.
inline const Ranks& ranks_of(const RunControl& control) {
  return control.ranks != nullptr ? *control.ranks : one_rank();
}

/// The control without a device if several ranks share the run, and with one answer for all: the first rank says when a
/// checkpoint is due and saves it, and the others take part in writing it. Errors: BadOption if elements are to be
/// split.
Expected<RunControl> control_of_ranks(RunControl control, const Options& options);

/// What this rank's caller says after an iteration. If several ranks share the run, it ends for all when one says so;
/// all call it together.
Control told_by_all(const OnIteration& on_iteration, const Iteration& iteration, const RunControl& control);

}  // namespace varimesh
