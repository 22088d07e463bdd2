// `optimise` in several processes that share the work.
#pragma once

#include "client/runs/optimise_run.h"
#include "core/ranks/ranks.h"

namespace varimesh::client {

/// All ranks call it, and all return the same exit status, but for the first one if it cannot write the result. The
/// first rank reads the mesh and sends it to the others. What only one process can do is refused.
int optimise_of_ranks(const OptimiseArguments& arguments, const Ranks& ranks);

}  // namespace varimesh::client
