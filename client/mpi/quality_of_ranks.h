// `quality` in several processes that share the work.
#pragma once

#include "client/runs/quality_run.h"
#include "core/ranks/ranks.h"

namespace varimesh::client {

/// What to say if the memory of a rank is too small.
inline constexpr const char* kNoRoomForPart =
    "There is not enough memory for a rank's part of the mesh; use more ranks, on more machines.";

/// All ranks call it, and all return the same exit status. Flags for which a rank would need the whole mesh are
/// refused.
int quality_of_ranks(const QualityArguments& arguments, const Ranks& ranks);

}  // namespace varimesh::client
