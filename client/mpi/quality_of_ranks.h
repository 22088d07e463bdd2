// `quality` in several processes that share the work.
#pragma once

#include "client/runs/quality_run.h"
#include "core/ranks/ranks.h"

namespace varimesh::client {

/// All ranks call it, and all return the same exit status. Flags for which a rank would need the whole mesh are
/// refused.
int quality_of_ranks(const QualityArguments& arguments, const Ranks& ranks);

}  // namespace varimesh::client
