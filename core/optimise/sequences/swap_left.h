// Swaps and collapses at the end of a run with Repair::Topology. Internal to core/optimise.
#pragma once

#include <cstdint>
#include <functional>

#include "core/base/stop_token.h"
#include "core/optimise/result.h"
#include "core/options/options.h"

namespace varimesh {

/// Changes how triangles and tetrahedra are connected around those of the result that are not certified valid, and, if
/// the objective is accuracy, around those below Options::min_js (core/repair/swaps/swap_passes.h). Sets the mesh, its
/// sizes, the quality afterwards and the repairs. Elements with a folded boundary face are left out. Returns whether
/// anything was changed. `on_pass` is told how many elements are wanted before each pass.
bool swap_left(Result& result, const Options& options, StopToken& stop,
               const std::function<void(std::int64_t wanted)>& on_pass);

}  // namespace varimesh
